"""``magcomp heading``: what a compass says, what it says corrected, and fused with the gyro."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from magcomp import __version__, autopilots
from magcomp.analysis import Options
from magcomp.autopilots import Autopilot
from magcomp.cli.heading_live import Following, follow, is_live
from magcomp.cli.linking import LinkOptions, positive_seconds, reach_options, say_meaning
from magcomp.cli.options import Selection, selection_options
from magcomp.cli.output import answer, answer_words, complain, look, wrapped
from magcomp.cli.work import fit_log, read_log, read_parameters
from magcomp.compensate import Gravity, Track, track
from magcomp.errors import ExitCode, MissingDataError, ParameterFileError, UsageError
from magcomp.experiments.motion import HeadingAccuracy, accuracy, heading_errors
from magcomp.geometry import wrap_angle
from magcomp.model import FloatArray, Grade, InForce, Recording, Series
from magcomp.report.as_json import SCHEMA
from magcomp.report.words import printable
from magcomp.sources.truth import Truth, read_truth

_NAMES = ("raw", "corrected", "fused")
_SIGNS = (".", "+", "•")
_COLOURS = ("red", "blue", "green")
_ROWS = 16
_TELLS_TRUTH = "tlog"
_WHOLE = (-math.inf, math.inf)
_PLOT_LINES = 18


@dataclass(frozen=True, eq=False)
class _Answer:
    """Headings by name, what they rest on, and the truth where there is one."""

    recording: Recording
    track: Track
    origin: str
    regressor: str | None
    truth: Truth | None

    @property
    def headings(self) -> dict[str, Series]:
        made = self.track
        found = {
            "raw": Series(made.time, made.reported),
            "corrected": Series(made.time, made.corrected),
        }
        return found if made.fused is None else {**found, "fused": made.fused}

    @property
    def accuracies(self) -> dict[str, HeadingAccuracy]:
        if self.truth is None:
            return {}
        judged = {
            name: accuracy(self.truth, series.time, series.value)
            for name, series in self.headings.items()
        }
        return {name: value for name, value in judged.items() if value is not None}


@click.command("heading")
@click.argument("source", metavar="LOG|ADDRESS")
@click.option(
    "--parameters",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Correct by a parameter file, for example of another log's fit.",
)
@click.option("--in-force", is_flag=True, help="Correct as the autopilot did: by the log's own.")
@click.option(
    "--gravity",
    type=click.Choice(["attitude", "accelerometer"]),
    default="attitude",
    show_default=True,
    help="Where the fusion takes the direction of gravity from.",
)
@selection_options
@reach_options
@click.option("--seconds", type=float, metavar="S", help="End a live one then; else by Ctrl-C.")
@click.option("--json", "to_json", is_flag=True, help="Print JSON: one object, live one a line.")
@click.option("--plot", is_flag=True, help="Draw the headings in the terminal.")
def heading(
    source: str,
    parameters: Path | None,
    in_force: bool,
    gravity: Gravity,
    selection: Selection,
    link: LinkOptions,
    seconds: float | None,
    to_json: bool,
    plot: bool,
) -> ExitCode:
    """Show the heading through LOG, or of the vehicle at ADDRESS: raw, corrected, fused.

    Raw is the field as the autopilot reported it. The correction comes from a fit of LOG itself
    unless --parameters or --in-force says otherwise. In a simulation's log, whose truth is known,
    the error of each is shown. A live vehicle is corrected by what it holds, or --parameters.
    """
    if parameters is not None and in_force:
        raise UsageError("Either --parameters or --in-force must be given; instead received both")
    compass = 1 if selection.compass is None else selection.compass
    if is_live(source):
        of_a_log = (selection.start, selection.end, selection.battery, selection.attitude)
        if plot or gravity != "attitude" or of_a_log != (*_WHOLE, None, None):
            raise UsageError(
                f"--plot, --gravity, --start, --end, --battery and --attitude must come with a "
                f"log; instead received one with {source}"
            )
        chosen = {} if parameters is None else _chosen(parameters, autopilots.ALL)
        wanted = Following(compass, chosen, positive_seconds(seconds) or math.inf, to_json)
        whom = replace(link, system=selection.system, component=selection.component)
        return follow(say_meaning(source), whom, wanted)
    if seconds is not None:
        raise UsageError("--seconds must come with a live vehicle; instead received it with a log")
    log = Path(source)
    recording, correction, origin, form = _correction(log, compass, parameters, in_force, selection)
    made = track(
        recording,
        compass,
        correction.correction,
        correction.regressor,
        exponent=correction.exponent,
        origin=form,
        gravity=gravity,
        start=selection.start,
        end=selection.end,
    )
    found = _Answer(recording, made, origin, correction.regressor, _truth(recording, selection))
    if to_json:
        answer(json.dumps(_document(found), allow_nan=False) + "\n")
        return ExitCode.GOOD
    answer_words(_text(found))
    if plot:
        answer_words(_plots(found))
    return ExitCode.GOOD


def _correction(
    log: Path, compass: int, parameters: Path | None, in_force: bool, selection: Selection
) -> tuple[Recording, InForce, str, str]:
    """The recording, what to correct it by, where that comes from, and by what, in words."""
    if parameters is None and not in_force:
        options = Options(compass, start=selection.start, end=selection.end)
        recording, analysis = fit_log(log, options, selection)
        result = analysis.compasses[0]
        if result.verdict.grade is Grade.REJECTED:
            complain(f"the fit used here is rejected: {result.verdict.reasons[0]}")
        fit = result.fit
        return (
            recording,
            InForce(fit.correction, fit.regressor),
            f"a fit of this log ({result.verdict.grade.value})",
            fit.origin,
        )
    recording = read_log(log, selection)
    autopilot, values = autopilots.of(recording), recording.parameters.latest
    if parameters is None:
        return recording, autopilot.in_force(values, compass), "the log's own parameters", ""
    chosen = _chosen(parameters, [autopilot])
    return recording, autopilot.in_force({**values, **chosen}, compass), str(parameters), ""


def _chosen(parameters: Path, known: Sequence[Autopilot]) -> Mapping[str, float]:
    chosen = read_parameters(parameters).values
    prefixes = tuple(autopilot.compass_prefix for autopilot in known)
    if not any(name.startswith(prefixes) for name in chosen):
        raise ParameterFileError(
            f"{parameters} must hold {' or '.join(prefixes)} parameters; instead it holds none"
        )
    return chosen


def _truth(recording: Recording, selection: Selection) -> Truth | None:
    if recording.format != _TELLS_TRUTH:
        return None
    try:
        return read_truth(recording.source, system=selection.system, component=selection.component)
    except MissingDataError:
        return None


def _document(found: _Answer) -> dict[str, Any]:
    made = found.track
    return {
        "magcomp": __version__,
        "schema": SCHEMA,
        "source": found.recording.source,
        "compass": made.compass,
        "correction": {"from": found.origin, "regressor": found.regressor},
        "lag_s": {"field": made.field_lag_s, "regressor": made.regressor_lag_s},
        "declination_deg": math.degrees(made.declination),
        "headings": {
            name: {"time_s": _numbers(series.time), "deg": _numbers(_degrees(series.value))}
            for name, series in found.headings.items()
        },
        "error_deg": {
            name: {"max": judged.largest, "rms": judged.rms}
            for name, judged in found.accuracies.items()
        }
        or None,
    }


def _numbers(values: FloatArray) -> list[float | None]:
    return [round(value, 3) if math.isfinite(value) else None for value in values.tolist()]


def _degrees(heading: FloatArray) -> FloatArray:
    return np.degrees(heading) % 360.0


def _text(found: _Answer) -> str:
    """Some rows of the headings, and how good they are."""
    made, headings = found.track, found.headings
    by = "no motor correction" if found.regressor is None else f"against {found.regressor}"
    lines = [
        "",
        f" {printable(found.recording.source)}, compass {made.compass}",
        *wrapped(
            f"corrected by {printable(found.origin)}, {by}; "
            f"the field is {1000 * made.field_lag_s:.0f} ms late, "
            f"declination {math.degrees(made.declination):+.1f}°",
            look().columns,
        ),
        "",
        "".join([f" {'time, s':>9}", *(f"{name:>13}" for name in headings)]),
    ]
    rows = np.unique(np.linspace(0, len(made.time) - 1, _ROWS).astype(int))
    for moment in made.time[rows].tolist():
        cells = (_at(series, moment) for series in headings.values())
        lines.append("".join([f" {moment:9.1f}", *(f"{cell:>13}" for cell in cells)]))
    return "\n".join([*lines, "", *_quality(found), ""]) + "\n"


def _at(series: Series, moment: float) -> str:
    """A heading at any moment, between its neighbours along the shorter way."""
    known = np.isfinite(series.value)
    if not known.any() or moment < series.time[known][0]:
        return "–"
    value = np.interp(moment, series.time[known], np.unwrap(series.value[known]))
    return f"{np.degrees(value) % 360.0:.1f}°"


def _quality(found: _Answer) -> list[str]:
    """Error against the truth; without one, distance from the fused heading."""
    accuracies = found.accuracies
    if accuracies:
        title = "error against the simulation's truth"
    else:
        title = "distance from the fused heading"
        accuracies = _from_fused(found)
    if not accuracies:
        return []
    lines = [f" {title}", "".join([" " * 10, *(f"{name:>13}" for name in accuracies)])]
    for label, field in (("largest", "largest"), ("rms", "rms")):
        cells = (f"{getattr(judged, field):.2f}°" for judged in accuracies.values())
        lines.append("".join([f" {label:>9}", *(f"{cell:>13}" for cell in cells)]))
    return lines


def _from_fused(found: _Answer) -> dict[str, HeadingAccuracy]:
    made = found.track
    if made.fused is None:
        return {}
    known = np.isfinite(made.fused.value)
    # A gyro that is told every few seconds cannot carry a heading.
    if not known.any():
        return {}
    unwrapped = np.unwrap(made.fused.value[known])
    fused = np.interp(made.time, made.fused.time[known], unwrapped)
    apart = {
        name: np.degrees(np.abs(wrap_angle(series.value - fused)))
        for name, series in found.headings.items()
        if name != "fused"
    }
    return {
        name: HeadingAccuracy(float(far.max()), float(np.sqrt(np.mean(far**2))))
        for name, far in apart.items()
    }


def _plots(found: _Answer) -> str:
    shown = {name: (s.time, _degrees(s.value)) for name, s in found.headings.items()}
    text = _plot("heading, °", shown, (0.0, 360.0))
    if found.truth is None:
        return text
    errors = {}
    for name, series in found.headings.items():
        time, error = heading_errors(found.truth, series.time, series.value)
        errors[name] = (time, np.degrees(error))
    return text + _plot("error, °", errors, None)


def _plot(
    title: str,
    curves: dict[str, tuple[FloatArray, FloatArray]],
    limits: tuple[float, float] | None,
) -> str:
    # Only drawing needs it, and it is slow to import.
    import plotext  # noqa: PLC0415

    view = look()
    plotext.clear_figure()
    plotext.plotsize(view.columns, _PLOT_LINES)
    plotext.theme("clear")
    for (name, (time, value)), sign, colour in zip(curves.items(), _SIGNS, _COLOURS, strict=False):
        known = np.isfinite(value)
        plotext.scatter(
            time[known].tolist(),
            value[known].tolist(),
            marker=sign,
            label=name,
            color=colour if view.colour else None,
        )
    if limits is not None:
        plotext.ylim(*limits)
        plotext.yticks([0, 90, 180, 270, 360])
    plotext.title(title)
    plotext.xlabel("time, s")
    drawn = plotext.build()
    return f"{drawn if view.colour else plotext.uncolorize(drawn)}\n\n"
