"""The command line. Nothing heavy is imported before a command runs."""

from magcomp.cli.app import main

__all__ = ["main"]
