"""The command line: the only room that prints."""

from testbed.cli.entry import main

__all__ = ["main"]
