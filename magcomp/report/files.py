"""A report as a file; the suffix chooses the form."""

from __future__ import annotations

import json
import os
from pathlib import Path

from magcomp.analysis import Options
from magcomp.errors import OutputError, UsageError
from magcomp.model import Analysis, Recording
from magcomp.report import as_json

SUFFIXES = (".html", ".json", ".md")


def report_text(
    suffix: str,
    recording: Recording,
    analysis: Analysis,
    *,
    options: Options | None = None,
    written: str | None = None,
) -> str:
    """The text of a report.

    Parameters
    ----------
    suffix
        One of :data:`SUFFIXES`.
    recording, analysis
        What was analysed, and the answer.
    options
        What was asked for.
    written
        The parameter file the answer went to, if any.

    Raises
    ------
    UsageError
        For another suffix.
    """
    document = as_json.dumps(as_json.analysis_object(analysis, written))
    match suffix.lower():
        case ".json":
            return document
        case ".md":
            from magcomp.report.as_markdown import markdown  # noqa: PLC0415

            history = recording.parameters
            present = {name: history.last(name, 0.0) for name in history.names}
            return markdown(json.loads(document), present, options)
        case ".html":
            from magcomp.report.as_html import html  # noqa: PLC0415

            return html(recording, analysis, options=options, written=written)
    raise UsageError(
        f"A report must end in {', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}; instead received "
        f"{suffix or 'no suffix'}"
    )


def write_text(path: Path, text: str, *, force: bool = False) -> None:
    """Write a file whole or not at all.

    Raises
    ------
    OutputError
        Where the file exists and ``force`` is not set, or it cannot be written.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        if path.exists() and not force:
            raise OutputError(f"{path} must not exist yet; use --force to overwrite it")
        try:
            # A log's name may hold bytes that are no text.
            temporary.write_bytes(text.encode("utf-8", errors="replace"))
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(f"{path} must be writable; instead received: {error.strerror}") from error
