"""Whether the committed reports are of today's code: its fingerprint, and the plan that makes them again."""
