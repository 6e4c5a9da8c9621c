"""Recordings: every decision with its whole cause in an MCAP file, and reading them back. See `write` and `read`."""

from __future__ import annotations

from chairward.recording.read import Entry, entries, messages, read, read_plan
from chairward.recording.topics import LOG, PICTURES, PINS, PLAN, RECORDS, TOPICS
from chairward.recording.write import Recorder, RecorderSettings

__all__ = [
    "LOG",
    "PICTURES",
    "PINS",
    "PLAN",
    "RECORDS",
    "TOPICS",
    "Entry",
    "Recorder",
    "RecorderSettings",
    "entries",
    "messages",
    "read",
    "read_plan",
]
