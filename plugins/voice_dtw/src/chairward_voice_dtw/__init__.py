"""A person's own words, recognised by dynamic time warping."""
