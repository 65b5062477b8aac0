"""What every autopilot's parameters have in common, whatever its habits with them."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType


class Held:
    """Parameters with a type and a value each; subclasses say how they change.

    Attributes
    ----------
    version
        Counts the changes.
    """

    def __init__(self) -> None:
        self._types: dict[str, int] = {}
        self._values: dict[str, float] = {}
        self.version = 0

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def __contains__(self, name: object) -> bool:
        return name in self._values

    @property
    def values(self) -> Mapping[str, float]:
        """Every value, hidden ones too."""
        return MappingProxyType(self._values)

    def type_of(self, name: str) -> int:
        """MAV_PARAM_TYPE."""
        return self._types[name]
