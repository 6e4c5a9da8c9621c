"""A screen that anyone in the room understands: shows, stops, arms; served on the chair."""
