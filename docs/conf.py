"""How `make docs` builds the site: Sphinx, the pages of docs/ and of the repository's top."""

from __future__ import annotations

import re
from pathlib import Path

from sphinx.application import Sphinx

from magcomp import __version__

ROOT = Path(__file__).parents[1]

project = "magcomp"
author = "The magcomp developers"
copyright = author  # noqa: A001 - Sphinx's name for it
release = version = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["*.py"]
html_theme = "furo"
html_title = f"magcomp {__version__}"
html_copy_source = False
html_extra_path = ["schema"]

myst_heading_anchors = 3
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False

TOP = {
    "README.md": "index.md",
    "ARCHITECTURE.md": "architecture.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "LICENSE": "license.md",
}
"""Files of the repository's top, and the pages that hold nothing but them."""


def at_the_top(_app: Sphinx, name: str, source: list[str]) -> None:
    """Put a file of the top in its page's place, with links as they are from within docs/."""
    file = {page.removesuffix(".md"): file for file, page in TOP.items()}.get(name)
    if file is None:
        return
    text = (ROOT / file).read_text(encoding="utf-8")
    names = "|".join(map(re.escape, TOP))
    text = re.sub(rf"\]\(({names})\)", lambda found: f"]({TOP[found[1]]})", text)
    title = "" if text.startswith("# ") else f"# {name.capitalize()}\n\n"
    source[0] = f"{title}{text.replace('](docs/', '](')}\n\n{source[0]}"


def setup(app: Sphinx) -> None:
    """Called by Sphinx."""
    app.connect("source-read", at_the_top)
