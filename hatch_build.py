"""Puts the commit that a wheel or an sdist is built from into it, for `magcomp --version`."""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class CommitHook(BuildHookInterface[Any]):
    """Adds magcomp/COMMIT; a wheel that is built from an sdist keeps the sdist's."""

    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Called by hatchling before it builds."""
        root = Path(self.root)
        if version == "editable" or not (root / ".git").exists():
            return
        done = subprocess.run(
            ["git", "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"],
            cwd=root,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode == 0:
            file = Path(tempfile.mkdtemp()) / "COMMIT"
            file.write_text(done.stdout, encoding="ascii")
            build_data["force_include"][str(file)] = "magcomp/COMMIT"
