"""Options that say which vehicle is meant, of a log or a link that holds several."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import click

_Result = TypeVar("_Result")


def vehicle_options(command: Callable[..., _Result]) -> Callable[..., _Result]:
    """Give a command --system and --component, by those names."""
    system = click.option(
        "--system", type=click.IntRange(1, 255), metavar="N", help="MAVLink system of the vehicle."
    )
    component = click.option(
        "--component",
        type=click.IntRange(1, 255),
        metavar="N",
        help="MAVLink component of its autopilot, where it is not 1.",
    )
    return system(component(command))
