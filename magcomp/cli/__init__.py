"""The command line. Nothing heavy is imported before a command runs."""

from magcomp.process import prepare

prepare()

from magcomp.cli.app import main  # noqa: E402

__all__ = ["main"]
