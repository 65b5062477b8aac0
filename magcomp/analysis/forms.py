"""What the field of each compass may follow, and what to say where the form is too simple."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from magcomp.analysis.compare import Judged
from magcomp.judge.forms import forms
from magcomp.model import CURRENT, MOTORS, Control, Form, quantity_of


def compared(
    judged: Mapping[str, Sequence[Judged]], motors: Sequence[Control], throttle: Control | None
) -> Mapping[int, tuple[Form, ...]]:
    """By compass, what the field of a flight may follow; see :mod:`magcomp.judge.forms`.

    Parameters
    ----------
    judged
        Every compass fitted and judged, by kind.
    motors
        The current of each motor in its forms, where known.
    throttle
        The throttle, where known.
    """
    chosen = {each.fit.compass: each.problem.control for each in judged.get(MOTORS, ())}
    found = {}
    for each in judged.get(CURRENT, ()):
        if each.fit.method == "flight":
            control = chosen.get(each.fit.compass) or next(iter(motors), None)
            found[each.fit.compass] = forms(each.problem, each.fit, control, throttle)
    return found


def forms_notes(
    by_compass: Mapping[int, tuple[Form, ...]], judged: Mapping[str, Sequence[Judged]], chosen: str
) -> Iterable[str]:
    """What the comparison says that the chosen form does not have."""
    better: dict[str, list[tuple[int, Form, Form]]] = {}
    for compass, tried in by_compass.items():
        best = next((form for form in tried if form.is_best), None)
        if best is None:  # what none of them leaves can be told
            continue
        now = next((form for form in tried if form.name == chosen), tried[0])
        if best.count > now.count:
            better.setdefault(best.name, []).append((compass, best, now))
    for name, found in better.items():
        whose = "compass " + ", ".join(str(compass) for compass, _, _ in found)
        leaves = (
            f"leaves {_listed(best.held_out for _, best, _ in found)} instead of "
            f"{_listed(now.held_out for _, _, now in found)} mGauss on unseen data"
        )
        costs = f"up to {_listed(now.left_deg for _, _, now in found)}° of heading in this flight"
        if name == MOTORS:
            yield (
                f"the motors disturb {whose} unequally: motor by motor {leaves}, and one {chosen} "
                f"costs {costs}; fit with --regressor motors"
            )
        else:
            fit = next(j.fit for j in judged[chosen] if j.fit.compass == found[0][0])
            quantity = quantity_of(fit.regressor)
            yield (
                f"what disturbs {whose} bends with the {chosen}: a curve {leaves}; the straight "
                f"value fitted here is the best one from {quantity.scale * fit.u_low:.0f} to "
                f"{quantity.text(fit.u_high)} and costs {costs}: fly in that range, or move the "
                "compass away from the wires"
            )


def _listed(values: Iterable[float]) -> str:
    return "/".join(f"{value:.1f}" for value in values)
