"""What is wrong on this machine and with this chair, each with one fix. It moves nothing.

Here is what a plugin needs to offer checks of its own; `doctor.examine` runs them.
"""

from __future__ import annotations

from chairward.findings import Check, Finding, Site, advised, not_tried

__all__ = ["Check", "Finding", "Site", "advised", "not_tried"]
