"""``python -m testbed`` is the command line."""

from testbed.cli.app import main

main()
