"""Chairward: drive a powered wheelchair by your own words, while sensors keep it from hitting things.

Not a certified medical device: its stop is a *protective stop*.
"""

API_VERSION = 1
"""Version of the plugin interface: a plugin says which one it was written for (see `chairward.plugins`)."""
