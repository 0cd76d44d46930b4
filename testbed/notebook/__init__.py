"""What a finished run shows of itself in Python: its table, its figures, its signals for other libraries."""

from testbed.notebook.run import Run, open_run

__all__ = ["Run", "open_run"]
