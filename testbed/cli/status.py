"""Exit status of the command line."""

OK, MISSED, BAD_INPUT, FAILED, INTERNAL, INTERRUPTED = 0, 1, 2, 3, 4, 130
