"""Recording → Readings and Controls → Samples: one compass, one row per new reading."""

from magcomp.align.control import controls, reported
from magcomp.align.readings import readings
from magcomp.align.sample import interpolate, sample

__all__ = ["controls", "interpolate", "readings", "reported", "sample"]
