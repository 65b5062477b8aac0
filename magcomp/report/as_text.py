"""An analysis as text for a terminal: the verdict first, then what it rests on."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console, Group, RenderableType
from rich.padding import Padding
from rich.rule import Rule
from rich.text import Text

from magcomp import __version__, autopilots
from magcomp.align import on_lift_alone
from magcomp.model import (
    CURRENT,
    Analysis,
    CompassResult,
    Grade,
    Recording,
    Vehicle,
    Verdict,
)
from magcomp.report import as_json, plain, tables, verdicts_text, words
from magcomp.report.ascii import in_words
from magcomp.report.bars import Row, bars
from magcomp.report.bend import steps_of
from magcomp.report.look import Look
from magcomp.report.roles import roles

_LOADED_BY = {".params": "QGroundControl (Parameters, Tools, Load from file)"}
_LOADED_BY_OTHERS = "your ground station (MAVProxy: param load)"


def analysis_text(
    analysis: Analysis,
    parameters: Mapping[str, float],
    present: Mapping[str, float],
    look: Look,
    *,
    written: str | None = None,
    report: str | None = None,
    verbose: bool = False,
    advise: bool = True,
) -> str:
    """What ``magcomp fit`` prints.

    Parameters
    ----------
    analysis
        The answer.
    parameters
        What is, or would be, written.
    present
        Parameters as the recording left them, for the difference.
    look
        Width and colour.
    written
        The parameter file it went to, if any.
    report
        The report that was written, if any.
    verbose
        The statistics, every parameter and every level.
    advise
        End with where the parameters are, and what to do next.
    """
    document = as_json.analysis_object(analysis)
    return render(
        [
            *_first_lines(plain.pilots_lines(document)),
            *_whose(analysis.source, analysis.vehicle, analysis.duration_s),
            *verdicts_text.of_analysis(analysis, document, verbose=verbose),
            *_roles(document),
            *evidence(analysis, verbose=verbose),
            *_parameters(parameters, present, verbose=verbose),
            *(_levels(analysis) if verbose else ()),
            *(_ending(analysis, document, written, report) if advise else ()),
        ],
        look,
    )


def check_text(
    recording: Recording,
    verdicts: Mapping[int, Verdict],
    kind: str,
    look: Look,
    asked: int | None = None,
) -> str:
    """What ``magcomp check`` prints.

    Parameters
    ----------
    recording, verdicts
        Of the log.
    kind
        The control quantity of the table.
    look
        Width and colour.
    asked
        The one compass that was asked for, if one was.
    """
    document = as_json.check_object(recording, verdicts, kind)
    parts: list[RenderableType] = [
        *_first_lines([plain.check_line(document)]),
        *_whose(recording.source, recording.vehicle, recording.duration_s),
    ]
    parts.extend(verdicts_text.of_check(verdicts, document))
    parts.append(Text())
    parts.append(tables.check(verdicts, kind))
    if left_out := on_lift_alone(recording)[1]:
        parts.append(_note(left_out))
    return render([*parts, *_not_judged(recording, verdicts, asked)], look)


def _not_judged(
    recording: Recording, verdicts: Mapping[int, Verdict], asked: int | None
) -> Iterator[RenderableType]:
    """The compasses of which too much is missing, where others were judged."""
    left = sorted(recording.field.keys() - verdicts.keys()) if asked is None else []
    if left:
        many = words.compasses(left)
        yield Text()
        yield Padding(
            Text(
                f"Not judged: {many}, of which the log holds too little; magcomp check --compass "
                f"{left[0]} says what."
            ),
            (0, 1),
        )


def truth_text(source: str, rows: Sequence[tuple[float, float, float]], look: Look) -> str:
    """Heading error against a simulation's truth.

    Parameters
    ----------
    source
        Where the truth stands.
    rows
        Current in A, and the true heading error before and after, degrees.
    look
        Width and colour.
    """
    drawn = [Row(words.quantity(u, CURRENT), (before, after)) for u, before, after in rows]
    worst = max(after for _, _, after in rows)
    return render(
        [
            Text(),
            Rule(Text("the truth", style="bold"), align="left", style="dim"),
            Text(f" {source}", style="dim", no_wrap=True, overflow="ignore"),
            Padding(
                Text(
                    "The vehicle was simulated, so its true interference is known; the fit never "
                    "saw it. With these parameters the heading of the worst compass is wrong by "
                    f"at most {worst:.2f}°:"
                ),
                (0, 1),
            ),
            Text(),
            bars("heading error", ("before", "after"), drawn),
            Text(),
            _last("Now a log of your own:", "magcomp fit FLIGHT.tlog -o compass.param"),
        ],
        look,
    )


def render(parts: Iterable[RenderableType], look: Look) -> str:
    """Lay the parts out, one under the other."""
    page = io.StringIO()
    console = Console(
        file=page,
        width=look.columns,
        force_terminal=look.colour,
        color_system="standard" if look.colour else None,
        legacy_windows=False,
        markup=False,
        emoji=False,
        highlight=False,
    )
    console.print(Group(*parts))
    # Rich fills lines with blanks, which only make a copied text untidy.
    text = "".join(f"{line.rstrip()}\n" for line in page.getvalue().splitlines())
    return in_words(text) if look.ascii_only else text


def heading(source: str, vehicle: Vehicle, duration_s: float) -> Iterator[RenderableType]:
    """The program's name, and whose recording this is."""
    yield _rule()
    yield from _whose(source, vehicle, duration_s)


def _rule() -> RenderableType:
    return Rule(Text(f"magcomp {__version__}", style="bold"), align="left", style="dim")


def _first_lines(lines: Sequence[str]) -> Iterator[RenderableType]:
    """What the pilot must know, before all else."""
    yield _rule()
    for line in lines:
        yield Padding(Text(line, style="bold"), (0, 1))
    yield Text()


def _whose(source: str, vehicle: Vehicle, duration_s: float) -> Iterator[RenderableType]:
    yield Text(f" {words.printable(source)}", style="bold", no_wrap=True, overflow="ignore")
    yield Text(f" {words.duration(duration_s)} of {words.vehicle(vehicle)}")
    if vehicle.device_ids:
        ids = ", ".join(map(str, vehicle.device_ids))
        yield Padding(Text(f"compass device ids {ids}", style="dim"), (0, 0, 0, 1))


def _roles(document: Mapping[str, Any]) -> Iterator[RenderableType]:
    """Which compass the autopilot uses, and what to do with each."""
    found = roles(document)
    if document["only_to_look_at"] or len(found) < 2:
        return
    yield Text()
    for role in found:
        line = Text(f"compass {role.compass}", style="bold")
        use = f" ({role.use})" if role.use else ""
        line.append(f"{use}: {role.action}", style="not bold")
        yield Padding(line, (0, 0, 0, 1))


def evidence(analysis: Analysis, *, verbose: bool = True) -> Iterator[RenderableType]:
    """What was found and what it rests on, a column a compass; statistics where verbose."""
    yield Text()
    yield tables.evidence(analysis.compasses, verbose=verbose)
    if analysis.compasses[0].fit.numbers:
        yield tables.motors(analysis.compasses)
    compared = [result for result in analysis.compasses if result.forms]
    if compared and (verbose or not all(result.forms[0].is_best for result in compared)):
        yield tables.forms(compared)
    if verbose:
        yield from _bends(analysis.compasses)
    yield Text()
    for why, numbers in _by_method(analysis.compasses).items():
        of = "" if len(numbers) == len(analysis.compasses) else f"{words.compasses(numbers)}: "
        yield _note(f"{of}{why}")
    for note in analysis.notes:
        yield _note(note)


def _bends(results: Sequence[CompassResult]) -> Iterator[RenderableType]:
    """What the motors add along their vector, straight as it is written and bent as it is."""
    for result in results:
        if (bend := steps_of(result)) is not None:
            curve, straight = bend.along()
            rows = [
                Row(words.quantity(u, result.fit.regressor), (float(line), float(bent)))
                for u, line, bent in zip(bend.u, straight, curve, strict=True)
            ]
            yield Text()
            title = f"compass {result.fit.compass}"
            yield bars(title, ("straight, mGauss", "as it bends"), rows, unit=" ")


def _by_method(results: Sequence[CompassResult]) -> dict[str, list[int]]:
    found: dict[str, list[int]] = {}
    for result in results:
        fit = result.fit
        why = f"method {fit.method}, because {fit.why}; {fit.regressor} from {fit.origin}"
        found.setdefault(why, []).append(fit.compass)
    return found


def _note(text: str) -> RenderableType:
    return Padding(Text(words.sentence(text), style="dim"), (0, 0, 0, 1))


def _parameters(
    values: Mapping[str, float], present: Mapping[str, float], *, verbose: bool
) -> Iterator[RenderableType]:
    if not values:
        return
    yield Text()
    changes, unchanged = tables.parameters(values, present, verbose=verbose)
    yield changes
    if unchanged:
        yield Padding(Text(f"unchanged: {', '.join(unchanged)}", style="dim"), (0, 0, 0, 1))


def _levels(analysis: Analysis) -> Iterator[RenderableType]:
    for result in analysis.compasses:
        title = f"compass {result.fit.compass}: centre of the raw readings, mGauss"
        yield Text()
        yield Padding(Text(title, style="bold"), (0, 0, 0, 1))
        yield tables.levels(result)


def _ending(
    analysis: Analysis, document: Mapping[str, Any], written: str | None, report: str | None
) -> Iterator[RenderableType]:
    yield Text()
    file = f"compass{autopilots.named(analysis.vehicle.autopilot).parameter_file}"
    accepted = analysis.grade is not Grade.REJECTED
    if analysis.only_to_look_at:
        yield _last("Nothing to write.", words.sentence(analysis.only_to_look_at))
        accepted = False
    elif written is not None:
        loader = _LOADED_BY.get(Path(written).suffix, _LOADED_BY_OTHERS)
        yield _last(
            f"Written to {words.printable(written)}.",
            f"Load it with {loader}, fly once more, and run magcomp check on the new log.",
        )
    elif plain.WRITE not in map(plain.answer_of, document["compasses"]) and accepted:
        yield _last("Nothing needs to be written.", f"-o {file} writes a file all the same.")
    elif accepted:
        yield _last("Nothing is written yet.", f"Add -o {file} to write these parameters.")
    else:
        yield _last("Nothing to write.", "Mend what the verdict names, record again, fit again.")
    rejected = [c.fit.compass for c in analysis.compasses if c.verdict.grade is Grade.REJECTED]
    if rejected and accepted:
        yield _last("", f"Left without compensation because rejected: {words.compasses(rejected)}.")
    elif rejected and written is not None:
        yield _last("", "The judge rejects this fit; it is written because of --force.")
    if report is not None:
        yield _last("", f"The report is in {words.printable(report)}.")


def _last(first: str, second: str) -> RenderableType:
    text = Text()
    text.append(first, style="bold")
    text.append(f"{' ' if first else ''}{second}")
    return Padding(text, (0, 0, 0, 1))
