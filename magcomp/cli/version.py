"""``magcomp --version``: the version, and the commit it was built from."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

import click

import magcomp

_TIMEOUT_S = 5.0


def commit() -> str:
    """The commit of the installed package, or of the checkout it runs from; empty where unknown."""
    told = resources.files(magcomp).joinpath("COMMIT")
    if told.is_file():
        return told.read_text(encoding="ascii").strip()
    root = Path(magcomp.__file__).parents[1]
    if not (root / ".git").exists():
        return ""
    import subprocess  # noqa: PLC0415 - a checkout is asked only for its version

    asked = ["git", "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"]
    try:
        done = subprocess.run(  # noqa: S603 - a fixed command
            asked, cwd=root, capture_output=True, text=True, check=False, timeout=_TIMEOUT_S
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def show_version(context: click.Context, _option: click.Parameter, wanted: bool) -> None:
    """Print it and end, where --version is given."""
    if not wanted or context.resilient_parsing:
        return
    built_from = commit()
    click.echo(f"magcomp {magcomp.__version__}" + (f" (commit {built_from})" if built_from else ""))
    context.exit()
