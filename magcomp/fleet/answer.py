"""What a run over a fleet answers with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from magcomp.fleet.aircraft import Aircraft
from magcomp.fleet.findings import Attention
from magcomp.fleet.flights import Flight, Selected


@dataclass(frozen=True, eq=False)
class Fleet:
    """The answer for all logs asked for.

    Attributes
    ----------
    aircraft
        Those that need attention first.
    selected
        The flights they are made of, and the logs that could not be used.
    logs
        How many were found.
    read
        How many of them were read now, because their results were not there yet.
    """

    aircraft: tuple[Aircraft, ...]
    selected: Selected
    logs: int
    read: int

    def needing(self, attention: Attention) -> Sequence[Aircraft]:
        """The aircraft that need just this attention."""
        return [each for each in self.aircraft if each.attention is attention]

    @property
    def unusable(self) -> tuple[Flight, ...]:
        """Logs without a fit."""
        return self.selected.unusable

    @property
    def fitted(self) -> int:
        """Logs with a fit."""
        return len({flight.digest for flight in self.selected.flights})
