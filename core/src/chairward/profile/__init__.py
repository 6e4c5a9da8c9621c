"""Profiles: what an integrator decides for a chair, what a person decides inside it, and the proof that it can stop.

    plan = load("sim", "demo", ["limits.stop_mm=700"], plugins.discover())

`errors` one sentence each; `merge` the safer-direction law; `models` what may stand in the files; `files` finding and
reading; `settings` of components; `lanes` order and votes; `proof` of distances; `refusals`; `limits` for the rules;
`load` puts it together; `write` new files and schemas.
"""

from __future__ import annotations

from chairward.profile.errors import ProfileError
from chairward.profile.load import Loaded, load, load_traced
from chairward.profile.merge import Safer

__all__ = ["Loaded", "ProfileError", "Safer", "load", "load_traced"]
