"""What holds for every test."""

from __future__ import annotations

from hypothesis import settings

# A busy machine is slow, not wrong: no test here is about the time of one example.
settings.register_profile("magcomp", deadline=None)
settings.load_profile("magcomp")
