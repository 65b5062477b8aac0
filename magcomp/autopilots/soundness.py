"""Which compasses a vehicle's parameters leave fit to be corrected, alike for every firmware."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from magcomp.errors import InputError
from magcomp.model import ParameterHistory


def unsound(
    parameters: ParameterHistory,
    names: Mapping[int, Iterable[str]],
    is_sound: Callable[[str, float], bool],
    not_sound: Callable[[Mapping[str, float]], InputError],
    not_usable: Callable[[int], InputError | None],
) -> dict[int, InputError]:
    """Compasses that must be left out, with the error that says so.

    Parameters
    ----------
    parameters
        All that the vehicle reported.
    names
        By compass number, the parameters that act on it.
    is_sound
        Whether a name may have had a value at any time.
    not_sound
        The error for names whose values were not.
    not_usable
        The error for a compass whose values are sound, but cannot be used together; None where
        they can.
    """
    found: dict[int, InputError] = {}
    for number, acting in names.items():
        bad = {
            name: change.value
            for name in acting
            for change in parameters.of(name)
            if not is_sound(name, change.value)
        }
        error = not_sound(bad) if bad else not_usable(number)
        if error is not None:
            found[number] = error
    return found
