"""Recording → Readings and Controls → Samples: one compass, one row per new reading."""

from magcomp.align.control import controls
from magcomp.align.readings import readings
from magcomp.align.sample import sample

__all__ = ["controls", "readings", "sample"]
