"""Recording → Readings and Controls → Samples: one compass, one row per new reading."""

from magcomp.align.control import controls, reported
from magcomp.align.expected import expected_earth, has_position
from magcomp.align.motors import (
    currents_of_motors,
    drawn_and_driven,
    drive_of_motors,
    to_undo,
)
from magcomp.align.phases import on_lift_alone
from magcomp.align.readings import readings, thinned, within
from magcomp.align.sample import sample

__all__ = [
    "controls",
    "currents_of_motors",
    "drawn_and_driven",
    "drive_of_motors",
    "expected_earth",
    "has_position",
    "on_lift_alone",
    "readings",
    "reported",
    "sample",
    "thinned",
    "to_undo",
    "within",
]
