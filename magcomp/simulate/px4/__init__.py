"""PX4 1.15's habits in a simulated vehicle: docs/autopilots.md, PX4: parameters.

Not simulated: calibrations that a ground station asks for, the estimate of a
bias on the ground (MBE_ENABLE), logs, missions.
"""

from magcomp.simulate.px4.firmware import Px4

__all__ = ["Px4"]
