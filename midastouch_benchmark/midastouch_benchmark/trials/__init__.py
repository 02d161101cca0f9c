"""Campaigns of trials on slides: protocols, what is done to a slide, variants, and what one trial is."""
