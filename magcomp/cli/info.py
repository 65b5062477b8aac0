"""``magcomp info``: what a log holds, and what it lacks for a fit."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click

from magcomp.analysis.contents import CompassContents, Contents, Quantity, contents
from magcomp.cli.options import Selection, json_option, log_argument, selection_options
from magcomp.cli.output import answer, answer_words, look, wrapped
from magcomp.cli.work import read_log
from magcomp.errors import ExitCode
from magcomp.model import Recording
from magcomp.report import as_json, words


@click.command("info")
@log_argument
@selection_options
@json_option
def info(log: Path, selection: Selection, to_json: bool) -> ExitCode:
    """Show what LOG holds, how often, and what it lacks for a fit; nothing is fitted."""
    recording = read_log(log, selection)
    found = contents(recording)
    if to_json:
        answer(as_json.dumps(_document(recording, found)))
    else:
        answer_words("\n".join(["", *_lines(recording, found, look().columns), "", ""]))
    return ExitCode.GOOD


def _document(recording: Recording, found: Contents) -> dict[str, Any]:
    report = recording.report
    return {
        **as_json.head(recording.source, recording.duration_s, recording.vehicle),
        "format": recording.format,
        "start_unix_s": recording.start_unix_s,
        "board": recording.vehicle.board,
        "frame": recording.vehicle.frame,
        "compasses": [_compass(each) for each in found.compasses],
        "quantities": [asdict(each) for each in found.quantities],
        "armed_s": found.armed_s,
        "parameters": {"count": found.parameters, "whole": recording.parameters.whole},
        "bytes": {"size": report.size, "skipped": report.skipped},
        "messages": {
            "found": report.frames,
            "used": report.used,
            "bad_checksum": report.bad_checksum,
            "duplicates": report.duplicates,
        },
        "notes": list(report.notes),
        "can_be_fitted": found.can_be_fitted,
        "missing": [asdict(each) for each in found.missing],
    }


def _compass(of: CompassContents) -> dict[str, Any]:
    described = of.described
    return {
        "compass": of.number,
        "device_id": None if described is None else described.device_id,
        "external": None if described is None else described.external,
        "used": None if described is None else described.used,
        "rows": of.rows,
        "readings": of.readings,
        "rate_hz": of.rate_hz,
        "strength_mgauss": of.strength,
        "correction_told_per_reading": of.applied_told,
        "left_out": of.left_out or None,
    }


def _lines(recording: Recording, found: Contents, columns: int) -> Iterator[str]:
    vehicle = recording.vehicle
    yield f" {words.printable(recording.source)}"
    of_it = [words.vehicle(vehicle), vehicle.board, vehicle.frame and f"frame {vehicle.frame}"]
    yield f" {words.duration(recording.duration_s)} of {', '.join(filter(None, of_it))}"
    yield from wrapped(
        f"{_began(recording.start_unix_s)}, {_parameters(recording, found)}", columns
    )
    if recording.report.skipped:
        yield f" {recording.report.skipped} bytes of {recording.report.size} belong to no message"
    if found.armed_s is not None:
        yield f" armed for {words.duration(found.armed_s)}"
    if found.compasses:
        yield ""
        yield f" {'compass':<24}{'a second':>9}{'readings':>10}   field, mGauss"
        for compass in found.compasses:
            yield (
                f" {_described(compass):<24}{_rate(compass.rate_hz):>9}{compass.readings:>10}"
                f"   {compass.strength:.0f}"
            )
    if found.quantities:
        yield ""
        yield f" {'quantity':<24}{'a second':>9}{'values':>10}   range"
        for quantity in found.quantities:
            yield (
                f" {quantity.name:<24}{_rate(quantity.rate_hz):>9}{quantity.count:>10}"
                f"   {_range(quantity)}"
            ).rstrip()
    yield ""
    yield from _verdict(recording, found, columns)


def _began(unix_s: float) -> str:
    if not math.isfinite(unix_s):
        return "date unknown"
    began = datetime.fromtimestamp(unix_s, UTC)
    return f"began on {began:%Y-%m-%d at %H:%M} UTC"


def _parameters(recording: Recording, found: Contents) -> str:
    if not found.parameters:
        return "no parameters"
    return f"{found.parameters} parameters{', the whole list' * recording.parameters.whole}"


def _described(compass: CompassContents) -> str:
    described = compass.described
    if described is None:
        return str(compass.number)
    where = {True: ", external", False: ", internal", None: ""}[described.external]
    return f"{compass.number}, id {described.device_id}{where}"


def _rate(rate_hz: float) -> str:
    return f"{rate_hz:.1f}" if math.isfinite(rate_hz) else "–"


def _range(quantity: Quantity) -> str:
    shown = "" if quantity.used else "not used"
    if math.isfinite(quantity.low) and math.isfinite(quantity.high):
        limits = f"{quantity.low:.1f} … {quantity.high:.1f} {quantity.unit}"
        return f"{limits}, {shown}" if shown else limits
    return shown


def _verdict(recording: Recording, found: Contents, columns: int) -> Iterator[str]:
    for compass in found.compasses:
        if compass.left_out:
            why = words.sentence(f"compass {compass.number} is left out: {compass.left_out}")
            yield from wrapped(why, columns)
    for note in recording.report.notes:
        yield from wrapped(words.sentence(note), columns)
    log = shlex.quote(words.printable(recording.source))
    if not found.missing:
        yield f" Nothing is missing. To fit it: magcomp fit {log}"
        return
    for missing in found.missing:
        weight = "No fit without" if missing.prevents else "A better fit with"
        yield from wrapped(f"{weight} {missing.what}: {missing.how}.", columns)
    if found.can_be_fitted:
        yield f" To fit it all the same: magcomp fit {log}"
