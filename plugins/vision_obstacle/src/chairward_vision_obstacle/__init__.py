"""Obstacles by their look: what does not look like the floor."""
