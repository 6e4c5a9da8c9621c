"""Laws are judged by what they find, not by how busy the machine is.

HYPOTHESIS_PROFILE=quick: few cases, always the same, for benchmarks/mutation.py, which asks only whether a test fails.
"""

from __future__ import annotations

import os

from hypothesis import HealthCheck, Phase, settings

settings.register_profile("chairward", deadline=None)
settings.register_profile(
    "quick",
    deadline=None,
    max_examples=20,
    derandomize=True,
    phases=[Phase.explicit, Phase.generate],
    suppress_health_check=list(HealthCheck),
)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "chairward"))
