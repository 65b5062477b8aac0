"""What the pilot has in hand: frozen, replaced as a whole, drawn by every screen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from magcomp.analysis import Options, parameter_set
from magcomp.model import Analysis, Grade, ParameterSet, Recording
from magcomp.tui.changes import ChangeRow
from magcomp.tui.fits import Tried, with_fit
from magcomp.tui.pictures import CompassPicture
from magcomp.tui.promise import Promise
from magcomp.tui.vehicle_card import VehicleCard


@dataclass(frozen=True, eq=False)
class Work:
    """One vehicle's or one log's work, from opening to writing.

    Attributes
    ----------
    source
        The log's path or the vehicle's address; empty before either.
    live
        Whether it is a vehicle.
    card
        What is known of the vehicle; None before it is.
    recording
        What was fitted last, or was read from a log.
    options
        Of the fit shown.
    analysis, pictures
        The answer, and what is drawn of it by compass; None and empty before a fit.
    chosen
        Compasses whose parameters are to be written.
    kept
        Where the answer was written: a file, or the vehicle; empty where nowhere yet.
    tried
        The fits so far, the shown one among them.
    """

    source: str = ""
    live: bool = False
    card: VehicleCard | None = None
    recording: Recording | None = None
    options: Options = field(default_factory=Options)
    analysis: Analysis | None = None
    pictures: Mapping[int, CompassPicture] = field(default_factory=dict)
    chosen: frozenset[int] = frozenset()
    kept: str = ""
    tried: tuple[Tried, ...] = ()

    @property
    def name(self) -> str:
        """The log's name, or the vehicle's address."""
        return self.source if self.live else Path(self.source).name

    @property
    def unwritten(self) -> bool:
        """There is an answer worth writing, and it is written nowhere."""
        worth = self.analysis is not None and self.analysis.grade is not Grade.REJECTED
        return worth and not self.kept

    @property
    def present(self) -> Mapping[str, float]:
        """Every parameter of the vehicle as the recording left it."""
        if self.recording is None:
            return {}
        return self.recording.parameters.latest

    @property
    def parameters(self) -> ParameterSet | None:
        """The parameters of the chosen compasses; None where there is nothing to write."""
        if self.analysis is None:
            return None
        found = parameter_set(self.analysis, compasses=self.chosen)
        return found if found.values else None

    def with_analysis(self, analysis: Analysis, pictures: Mapping[int, CompassPicture]) -> Work:
        """The same after a fit: everything not rejected is chosen, nothing is written."""
        good = (c for c in analysis.compasses if c.verdict.grade is not Grade.REJECTED)
        new = Tried(self.options, self.recording, analysis, pictures)
        return replace(
            self,
            tried=with_fit(self.tried, new),
            analysis=analysis,
            pictures=pictures,
            chosen=frozenset(result.fit.compass for result in good),
            kept="",
        )

    def with_other_fit(self) -> Work:
        """The same with the fit tried before the shown one; round and round."""
        here = [index for index, each in enumerate(self.tried) if each.analysis is self.analysis]
        if not here or len(self.tried) < 2:
            return self
        other = self.tried[here[0] - 1]
        work = replace(self, options=other.options, recording=other.recording)
        return replace(work.with_analysis(other.analysis, other.pictures), tried=self.tried)


@dataclass(frozen=True, eq=False)
class Writing:
    """What would be written, is being written, or was.

    Attributes
    ----------
    rows
        The parameters that change, with how far each is.
    warnings
        Sentences a pilot must read before.
    backup
        Where the old values go, or went; None for a log.
    result
        How it ended; empty before.
    acts
        Whether what was written is in force, where the vehicle shows it; else empty.
    before, in_force
        What the vehicle held before it was written, and what it holds since; empty where it was
        not written.
    undone
        What was written was taken back, and nothing was written since.
    promised, since_s
        The fit that was written, and the second of the recording since when it is in force.
    flying
        The motors have run since, and still do.
    measured, measured_trouble
        What the flights since showed, or why nothing.
    """

    rows: tuple[ChangeRow, ...] = ()
    warnings: tuple[str, ...] = ()
    backup: Path | None = None
    result: str = ""
    acts: str = ""
    before: Mapping[str, float] = field(default_factory=dict)
    in_force: Mapping[str, float] = field(default_factory=dict)
    undone: bool = False
    promised: Analysis | None = None
    since_s: float = 0.0
    flying: bool = False
    measured: tuple[Promise, ...] = ()
    measured_trouble: str = ""
