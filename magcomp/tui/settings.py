"""What a pilot sets once: theme, folder, keys; and what the program remembers by itself.

Two files, because a program must not rewrite a file that a person keeps comments in:

``settings.toml``
    Written by a person, only read here.
``state.json``
    Written here: addresses and logs used lately, and the theme chosen last.

A damaged state file is no reason to stop a pilot: it is left out of account. A damaged settings
file is: a key that does not do what was asked for is worse than a sentence at the start.
"""

from __future__ import annotations

import contextlib
import json
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import platformdirs

from magcomp.errors import UsageError

SETTINGS_FILE = "settings.toml"
STATE_FILE = "state.json"
MOST_RECENT = 6

TEMPLATE = """\
# Settings of `magcomp tui`. Take the # away from what you want to change.

# theme = "sun"            # "night", "sun" (for sunlight), or any theme of the command palette
# folder = "~/flights"     # where recordings and backups go

[keys]
# Every action has a name; F1 shows the names of the screen you are on.
# "app.quit" = "f10"
# "fit.method" = "m,f7"
"""


@dataclass(frozen=True)
class Settings:
    """What stands in the settings file.

    Attributes
    ----------
    theme
        Name of a theme; empty for the one used last.
    folder
        Where recordings and backups go; None for the platform's place.
    keys
        Name of an action to its keys, with commas between them.
    source
        The file, for messages.
    """

    theme: str = ""
    folder: Path | None = None
    keys: Mapping[str, str] = field(default_factory=dict)
    source: Path = Path(SETTINGS_FILE)


def settings_folder() -> Path:
    """The platform's place for settings."""
    return platformdirs.user_config_path("magcomp", appauthor=False)


def read_settings(folder: Path) -> Settings:
    """Read ``settings.toml``; all defaults where there is none.

    Raises
    ------
    UsageError
        Where it cannot be read, is not TOML, or holds what it must not.
    """
    path = folder / SETTINGS_FILE
    try:
        values = tomllib.loads(path.read_text("utf-8"))
    except FileNotFoundError:
        return Settings(source=path)
    except (OSError, UnicodeError) as error:
        raise UsageError(
            f"{path} must be a readable text file; instead received: {error}"
        ) from error
    except tomllib.TOMLDecodeError as error:
        raise UsageError(f"{path} must be TOML; instead received: {error}") from error
    unknown = sorted(set(values) - {"theme", "folder", "keys"})
    if unknown:
        raise UsageError(
            f"{path} must hold only theme, folder and keys; instead received {', '.join(unknown)}"
        )

    place = _text(path, values, "folder")
    return Settings(
        theme=_text(path, values, "theme"),
        folder=Path(place).expanduser() if place else None,
        keys=dict(_keys(path, values.get("keys", {}))),
        source=path,
    )


def write_template(folder: Path) -> Path:
    """Make a settings file to edit, if there is none, and tell where it is.

    Raises
    ------
    UsageError
        Where it cannot be written.
    """
    path = folder / SETTINGS_FILE
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with contextlib.suppress(FileExistsError), path.open("x", encoding="utf-8") as file:
            file.write(TEMPLATE)
    except OSError as error:
        raise UsageError(f"{path} must be writable; instead received: {error.strerror}") from error
    return path


def _text(path: Path, values: Mapping[str, Any], name: str) -> str:
    value = values.get(name, "")
    if not isinstance(value, str):
        raise UsageError(f"{path}: {name} must be a text in quotes; instead received {value!r}")
    return value


def _keys(path: Path, table: object, prefix: str = "") -> Iterator[tuple[str, str]]:
    """Names and keys; ``fit.method = "m"`` is a table in TOML, ``"fit.method" = "m"`` is not."""
    if not isinstance(table, dict):
        raise UsageError(f"{path}: keys must be a table; instead received {table!r}")
    for name, value in table.items():
        if isinstance(value, dict):
            yield from _keys(path, value, f"{prefix}{name}.")
        elif isinstance(value, str) and value.strip():
            yield f"{prefix}{name}", value
        else:
            raise UsageError(
                f'{path}: the key of {prefix}{name} must be a text such as "m" or "f7"; instead '
                f"received {value!r}"
            )


@dataclass(frozen=True)
class Remembered:
    """What the program remembers from one time to the next.

    Attributes
    ----------
    recent
        Addresses and logs, the latest first.
    theme
        Chosen last; empty where never.
    """

    recent: tuple[str, ...] = ()
    theme: str = ""

    def with_recent(self, target: str) -> Remembered:
        """The same with ``target`` in front."""
        others = [other for other in self.recent if other != target]
        return Remembered((target, *others)[:MOST_RECENT], self.theme)


def read_remembered(folder: Path) -> Remembered:
    """Read ``state.json``; nothing where there is none or it makes no sense."""
    try:
        values = json.loads((folder / STATE_FILE).read_text("utf-8"))
        recent, theme = values.get("recent", []), values.get("theme", "")
    except (OSError, ValueError, AttributeError):
        return Remembered()
    if not isinstance(recent, list) or not isinstance(theme, str):
        return Remembered()
    names = [name for name in recent if isinstance(name, str) and name.isprintable() and name]
    return Remembered(tuple(names[:MOST_RECENT]), theme)


def write_remembered(folder: Path, remembered: Remembered) -> None:
    """Write ``state.json``; a disk that cannot take it is no reason to trouble a pilot."""
    document = json.dumps({"recent": list(remembered.recent), "theme": remembered.theme}, indent=1)
    new = folder / f"{STATE_FILE}.new"
    with contextlib.suppress(OSError, UnicodeError):
        folder.mkdir(parents=True, exist_ok=True)
        new.write_text(document + "\n", encoding="utf-8")
        new.replace(folder / STATE_FILE)
