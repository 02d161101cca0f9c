"""Measurements of MidasTouch; nothing that runs on a robot imports them."""
