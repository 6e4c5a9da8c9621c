"""What is wrong on this machine and with this chair, each with one fix. It moves nothing."""

from __future__ import annotations

from chairward.doctor.check import Check, Finding, Site, advised, not_tried
from chairward.doctor.examine import examine

__all__ = ["Check", "Finding", "Site", "advised", "examine", "not_tried"]
