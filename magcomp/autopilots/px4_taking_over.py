"""Whether PX4 takes a written calibration over as it is written, when it starts, or never.

docs/autopilots.md, PX4: in force. It looks at its parameters whenever one has changed, once a
second at most, so that it may find half of a vector new. What is then left to change may be too
little for it to notice: it goes on with a mixture until it is started again.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping

import numpy as np

from magcomp.autopilots.px4_correction import (
    MGAUSS,
    SHAPE_ZONE,
    after_start,
    offset_zone,
    stored,
)
from magcomp.autopilots.px4_names import vector_names
from magcomp.model import FloatArray

_ATTRIBUTES = {"OFF": "offset", "SCALE": "scale", "ODIAG": "off_diagonal"}
_REST = {"OFF": "0", "SCALE": "1", "ODIAG": "0"}


def unsettled(
    asked: Mapping[str, float], held: Mapping[str, float], compass: int
) -> Iterator[tuple[str, str]]:
    """The vectors of a compass that a write leaves in doubt.

    Parameters
    ----------
    asked, held
        Parameters to be written, and what the vehicle holds.

    Yields
    ------
    tuple of str
        Name of the vector, and ``"late"`` where a restart settles it, ``"never"`` where PX4 goes
        on without it.
    """
    after = {**held, **asked}
    present, wanted = after_start(held, compass), stored(after, compass)
    started = after_start(after, compass)
    for kind, attribute in _ATTRIBUTES.items():
        names = vector_names(kind, compass)
        if all(asked.get(name, held.get(name)) == held.get(name) for name in names):
            continue
        name = f"CAL_MAG{compass - 1}_{kind}"
        aim = getattr(wanted, attribute)
        zone = offset_zone(after) if kind == "OFF" else SHAPE_ZONE
        if not np.array_equal(getattr(started, attribute), aim):
            yield name, "never"
        elif not _is_taken(getattr(present, attribute), aim, zone):
            yield name, "late"


def sentences(
    asked: Mapping[str, float], held: Mapping[str, float], compasses: tuple[int, ...]
) -> Iterator[str]:
    """What a pilot must know of that, without full stops."""
    found = [each for compass in compasses for each in unsettled(asked, held, compass)]
    late = [name for name, when in found if when == "late"]
    zone = (
        f"{MGAUSS * offset_zone({**held, **asked}):g} mGauss (OFF) or {SHAPE_ZONE} (SCALE, ODIAG)"
    )
    if late:
        yield (
            f"restart the vehicle after writing: until then PX4 may go on with part of the old "
            f"{', '.join(late)}, because it takes over no change below {zone}"
        )
    for name, when in found:
        if when == "never":
            rest = _REST[name.rsplit("_", 1)[1]]
            yield (
                f"{name} is never in force: PX4 takes a vector this near to {rest} for {rest}, "
                f"within {zone}"
            )


def _is_taken(present: FloatArray, aim: FloatArray, zone: float) -> bool:
    """Whether a vector is taken over whole, whichever of its parts are found new first."""
    moved = np.flatnonzero(aim != present)
    ways = [present]
    for count in range(1, len(moved)):
        for part in itertools.combinations(moved, count):
            half = present.copy()
            half[list(part)] = aim[list(part)]
            if np.linalg.norm(half - present) > zone:
                ways.append(half)
    return all(
        np.array_equal(before, aim) or float(np.linalg.norm(aim - before)) > zone for before in ways
    )
