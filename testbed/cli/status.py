"""Exit status of the command line."""

OK, MISSED, BAD_INPUT, FAILED, INTERRUPTED = 0, 1, 2, 3, 130
