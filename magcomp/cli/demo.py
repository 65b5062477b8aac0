"""``magcomp demo``: the whole job on a simulated vehicle, proven by flying once more."""

from __future__ import annotations

import contextlib
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import click

from magcomp import autopilots
from magcomp.analysis import Options, parameter_set
from magcomp.cli.linking import StatusLine
from magcomp.cli.output import answer, look, progress
from magcomp.cli.truth import KnownTruth
from magcomp.compensate import track
from magcomp.errors import ExitCode, LinkError, MissingDataError
from magcomp.experiments.motion import HeadingAccuracy, accuracy
from magcomp.link import DEFAULT_RATES
from magcomp.live.session import LiveSession
from magcomp.model import Analysis, Grade, ParameterSet, Recording
from magcomp.sources.truth import read_truth
from magcomp.writing.files import write_parameter_file
from magcomp.writing.writer import raise_for_failure

_CURRENTS = (0.0, 10.0, 20.0, 30.0, 40.0, 50.0)
_TRUTH_HZ = 20.0
_LOOK_S = 0.1
_PATIENCE_S = 30.0
_LANDED_S = 0.5


@dataclass(frozen=True)
class _Bench:
    """Where the demonstration takes place.

    Attributes
    ----------
    directory
        For its files; gone afterwards.
    seed, speed
        Which vehicle, and how many times faster than real time it lives.
    autopilot
        Whose firmware it has.
    """

    directory: Path
    seed: int
    speed: float
    autopilot: str

    def path(self, name: str) -> Path:
        return self.directory / name


@click.command("demo")
@click.option("--seed", type=int, default=1, show_default=True, help="Which vehicle.")
@click.option(
    "--speed",
    type=click.FloatRange(min=0.1, max=50.0),
    default=15.0,
    show_default=True,
    metavar="X",
    help="How many times faster than real time it flies.",
)
@click.option(
    "--autopilot",
    type=click.Choice([each.key for each in autopilots.ALL]),
    default=autopilots.ALL[0].key,
    show_default=True,
    help="Whose firmware it has.",
)
def demo(seed: int, speed: float, autopilot: str) -> ExitCode:
    """Show the whole job on a simulated vehicle: record, fit, write, verify, and fly once more.

    The vehicle is a process of its own, reached over UDP as a real one is. The fit sees only
    what a ground station would; what it found is then compared with the simulated truth.
    """
    status = StatusLine()
    with tempfile.TemporaryDirectory(prefix="magcomp-demo-") as directory:
        bench = _Bench(Path(directory), seed, speed, autopilot)
        _title("a flight")
        _line(
            f"A simulated {autopilots.named(autopilot).title} copter (seed {seed}) with three "
            f"compasses, over UDP, {speed:g} times "
            "faster than real time."
        )
        recording, analysis, wrote = _calibrated(bench, status)
        if not wrote:
            return ExitCode.REJECTED
        _title("the same flight, with what was written in force")
        flown = _flown_again(bench, status)
        _show_flown(bench, recording, flown)
        _show_truth(bench, recording, analysis)
    return ExitCode.GOOD


def _calibrated(bench: _Bench, status: StatusLine) -> tuple[Recording, Analysis, bool]:
    """Record, fit, write, read back."""
    with (
        _vehicle(bench, "--truth", str(bench.path("truth.json"))) as address,
        _session(bench, address, "first.tlog") as session,
    ):
        _fly(session, bench, status)
        with progress() as step:
            recording = session.recording()
            analysis = session.analyse(
                Options(), lambda what, share: step(f"fitting {what}", share)
            )
        chosen = parameter_set(analysis)
        _show_analysis(recording, analysis, chosen)
        if analysis.grade is Grade.REJECTED:
            return recording, analysis, False
        _write(session, chosen, bench, status)
        return recording, analysis, True


def _write(session: LiveSession, chosen: ParameterSet, bench: _Bench, status: StatusLine) -> None:
    _title("write")
    plan = session.upload_plan(chosen)
    backup, begun = bench.path("backup.param"), time.monotonic()
    status.show("writing")
    outcome = session.upload(plan, backup)
    status.clear()
    raise_for_failure(outcome, backup)
    took = time.monotonic() - begun
    _line(
        f"{len(plan.changes)} parameters written while disarmed, each read back as it was sent, in "
        f"{took:.1f} s. Magcomp keeps a backup and a journal beside it; magcomp restore brings "
        "everything back."
    )
    held = session.upload_plan(chosen)
    if held.changes:
        raise LinkError("The vehicle must hold what was written; instead it holds something else.")
    write_parameter_file(bench.path("held.param"), ParameterSet(held.old))


def _flown_again(bench: _Bench, status: StatusLine) -> Recording:
    """Switch the vehicle off and on, and let it fly the same way."""
    held = bench.path("held.param")
    with (
        _vehicle(bench, "--parameters", str(held)) as address,
        _session(bench, address, "second.tlog") as session,
    ):
        _fly(session, bench, status)
        return session.recording()


def _fly(session: LiveSession, bench: _Bench, status: StatusLine) -> None:
    """Record from before the start until the vehicle is disarmed again."""
    status.show("waiting for the vehicle")
    session.wait_ready(_PATIENCE_S)
    begun, was_armed, landed_at = time.monotonic(), False, None
    before = sum(session.snapshot().level_seconds)
    while landed_at is None or time.monotonic() - landed_at < _LANDED_S:
        time.sleep(_LOOK_S)
        shown = session.snapshot()
        was_armed = was_armed or bool(shown.armed)
        if was_armed and not shown.armed and landed_at is None:
            landed_at = time.monotonic()
        if not shown.connected:
            raise LinkError("The simulated vehicle must keep talking; instead it fell silent.")
        current = "" if shown.current is None else f"{shown.current:5.1f} A  "
        height = "" if shown.height_m is None else f"{shown.height_m:4.0f} m  "
        status.show("recording", f"{sum(shown.level_seconds):4.0f} s  {height}{current}")
    session.stop_recording()
    status.clear()
    shown = session.snapshot()
    flown, took = sum(shown.level_seconds) - before, time.monotonic() - begun
    _line(
        f"Recorded {flown:.0f} s of its time in {took:.0f} s ({flown / took:.0f} times real time), "
        f"{shown.link.frames} messages, {shown.link.lost} lost."
    )
    if flown < bench.speed:
        raise MissingDataError("The simulated vehicle must fly; instead it did not.")


def _session(bench: _Bench, address: str, record: str) -> LiveSession:
    rates = {**DEFAULT_RATES, autopilots.named(bench.autopilot).truth_message: _TRUTH_HZ}
    return LiveSession.open(
        address, record=bench.path(record), system=1, rates=rates, refit_share=0.0
    )


@contextlib.contextmanager
def _vehicle(bench: _Bench, *options: str) -> Iterator[str]:
    """A simulated vehicle in a process of its own; gives its address."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "magcomp", "simulate", f"udpout:127.0.0.1:{port}"]
    command += ["--seed", str(bench.seed), "--speed", str(bench.speed)]
    command += ["--autopilot", bench.autopilot, *options]
    with subprocess.Popen(  # noqa: S603 - our own program
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as child:
        try:
            yield f"udp:127.0.0.1:{port}"
        finally:
            child.terminate()


# -------------------------------------------------------------------------- what is shown


def _title(text: str) -> None:
    from rich.rule import Rule  # noqa: PLC0415 - rich only where text is made
    from rich.text import Text  # noqa: PLC0415

    from magcomp.report import as_text  # noqa: PLC0415

    rule = Rule(Text(text, style="bold"), align="left", style="dim")
    answer(as_text.render([Text(), rule], look()))


def _line(text: str) -> None:
    from rich.padding import Padding  # noqa: PLC0415 - rich only where text is made

    from magcomp.report import as_text  # noqa: PLC0415

    answer(as_text.render([Padding(text, (0, 1))], look()))


def _show_analysis(recording: Recording, analysis: Analysis, chosen: ParameterSet) -> None:
    from magcomp.report import as_text  # noqa: PLC0415 - rich only where text is made

    present = recording.parameters.latest
    answer("\n")
    answer(as_text.analysis_text(analysis, chosen.values, present, look(), advise=False))


def _show_flown(bench: _Bench, before: Recording, after: Recording) -> None:
    """What the autopilot's compasses were wrong by, in both flights."""
    from magcomp.report import as_text  # noqa: PLC0415 - rich only where text is made
    from magcomp.report.bars import Row, bars  # noqa: PLC0415

    errors = {
        "before": _errors(before, bench.path("first.tlog")),
        "after": _errors(after, bench.path("second.tlog")),
    }
    rows = [
        Row(f"compass {compass}", (errors["before"][compass].rms, errors["after"][compass].rms))
        for compass in errors["before"]
    ]
    worst = {name: max(found[c].largest for c in found) for name, found in errors.items()}
    answer("\n")
    answer(as_text.render([bars("rms in flight", ("before", "after"), rows)], look()))
    _line(
        f"The worst single reading was wrong by {worst['before']:.1f}° before, by "
        f"{worst['after']:.1f}° after, noise and turns included."
    )


def _errors(recording: Recording, path: Path) -> Mapping[int, HeadingAccuracy]:
    """Heading as the autopilot's own correction gave it, against the true heading."""
    truth, autopilot, said = read_truth(path), autopilots.of(recording), recording.parameters
    # A firmware may store what it learned in the air when it is disarmed.
    values = {name: said.of(name)[0].value for name in said.names}
    found = {}
    for compass in sorted(recording.field):
        in_force = autopilot.in_force(values, compass)
        made = track(recording, compass, in_force.correction, in_force.regressor)
        raw_is_sent = autopilot.corrected_message is not None
        heading = made.corrected if raw_is_sent else made.reported
        judged = accuracy(truth, made.time, heading)
        if judged is None:
            raise MissingDataError("The simulated flight must show its truth; instead it does not.")
        found[compass] = judged
    return found


def _show_truth(bench: _Bench, recording: Recording, analysis: Analysis) -> None:
    """Heading error at steady currents, computed from the truth and the parameters."""
    from magcomp.report import as_text  # noqa: PLC0415 - rich only where text is made

    truth = KnownTruth(bench.path("truth.json"))
    autopilot, before = autopilots.of(recording), recording.parameters.latest
    after = {**before, **parameter_set(analysis).values}
    compasses = [result.fit.compass for result in analysis.compasses]

    def worst(parameters: Mapping[str, float], amperes: float) -> float:
        return max(
            truth.heading_error_deg(
                autopilot.in_force(parameters, compass).correction,
                compass,
                amperes,
                recording.start_unix_s,
            )
            for compass in compasses
        )

    rows = [(amperes, worst(before, amperes), worst(after, amperes)) for amperes in _CURRENTS]
    answer(as_text.truth_text(f"a simulated vehicle, seed {bench.seed}", rows, look()))
