"""Correction in flight: one reading at a time, a log at once, and fused with the gyro."""

from magcomp.compensate.compensator import Compensator
from magcomp.compensate.equations import (
    disturbance,
    level_components,
    level_heading_shift,
    shift_per_size,
)
from magcomp.compensate.fusion import Fusion, Heading, Motion, Reading, Tuning, fuse
from magcomp.compensate.track import Gravity, Track, events, track

__all__ = [
    "Compensator",
    "Fusion",
    "Gravity",
    "Heading",
    "Motion",
    "Reading",
    "Track",
    "Tuning",
    "disturbance",
    "events",
    "fuse",
    "level_components",
    "level_heading_shift",
    "shift_per_size",
    "track",
]
