"""A simulated home, chair and person: the physical world behind the real plugins."""
