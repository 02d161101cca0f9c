"""Campaigns of trials on slides: protocols, disturbances, variants, and single trials."""
