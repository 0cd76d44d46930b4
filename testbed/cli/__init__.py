"""The command line: the only room that prints."""

from testbed.cli.app import main

__all__ = ["main"]
