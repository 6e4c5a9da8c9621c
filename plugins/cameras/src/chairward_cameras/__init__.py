"""A webcam pair, or recorded pairs."""
