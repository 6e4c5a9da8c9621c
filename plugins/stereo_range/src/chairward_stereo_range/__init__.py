"""Distances by stereo, stereo calibration, and their evaluation."""
