"""A microphone, or recorded sound."""
