"""A vehicle to work on when there is none: ArduCopter 4.6's or PX4 1.15's behaviour on MAVLink.

Without a link and in no time: :func:`write_tlog`, a :class:`Vehicle` that is
given frames and time, or a :class:`LocalConnection` to one. On a link in real time: :func:`serve`.
"""

from magcomp.simulate.faults import Faults, FaultyLink, Machine
from magcomp.simulate.habits import CAMERA, COMPUTER, GIMBAL, Companion, Habits
from magcomp.simulate.local import LocalConnection
from magcomp.simulate.programs import PROGRAMS, Scenario, scenario
from magcomp.simulate.recording import record, write_tlog
from magcomp.simulate.server import run, serve
from magcomp.simulate.truth import Truth
from magcomp.simulate.vehicle import AUTOPILOTS, Frame, Vehicle

__all__ = [
    "AUTOPILOTS",
    "CAMERA",
    "COMPUTER",
    "GIMBAL",
    "PROGRAMS",
    "Companion",
    "Faults",
    "FaultyLink",
    "Frame",
    "Habits",
    "LocalConnection",
    "Machine",
    "Scenario",
    "Truth",
    "Vehicle",
    "record",
    "run",
    "scenario",
    "serve",
    "write_tlog",
]
