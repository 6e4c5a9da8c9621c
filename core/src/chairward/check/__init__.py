"""Checks that a person runs on a chair, wheels off the ground first: what they measure, apart from the command line."""
