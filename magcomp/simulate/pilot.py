"""Who carries the programme out: asks it for the movement of the coming blocks."""

from __future__ import annotations

import numpy as np

from magcomp.simulate.motion import FloatArray, Motion, Program
from magcomp.simulate.physics import STEP_S, STEPS

_BLOCKS_AHEAD = 20


class Pilot:
    """Gives the movement block by block.

    A programme that does not heed the heading is asked for many blocks at once:
    numpy works through two seconds nearly as fast as through a tenth of one.

    Parameters
    ----------
    program
        What to carry out.
    """

    def __init__(self, program: Program) -> None:
        self._program = program
        self._first = 0
        self._ahead: list[Motion] = []

    def block(self, step: int, heading_error: float) -> Motion:
        """Movement at the ten steps after ``step``, which counts from the programme's start."""
        if self._program.heeds_heading:
            return self._program.motion(_times(step, STEPS), heading_error)
        index, off = divmod(step - self._first, STEPS)
        if off or not 0 <= index < len(self._ahead):
            motion = self._program.motion(_times(step, STEPS * _BLOCKS_AHEAD), heading_error)
            self._ahead = [
                motion.part(slice(k * STEPS, (k + 1) * STEPS)) for k in range(_BLOCKS_AHEAD)
            ]
            self._first, index = step, 0
        return self._ahead[index]

    def before_start(self) -> Motion:
        """Movement of a block while the programme has not begun."""
        return self._program.motion(np.zeros(STEPS), 0.0)


def _times(step: int, count: int) -> FloatArray:
    """Seconds since the programme began, of ``count`` steps after ``step``."""
    return np.arange(step + 1, step + 1 + count, dtype=np.float64) * STEP_S
