"""Where to touch next."""
