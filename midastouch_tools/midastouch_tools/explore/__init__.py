"""What a person sees of an exploration: its progress, its page."""
