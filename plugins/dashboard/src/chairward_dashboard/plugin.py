"""What this plugin offers: registered once, at start, without touching a device."""

from __future__ import annotations

CHAIRWARD_API = 1
