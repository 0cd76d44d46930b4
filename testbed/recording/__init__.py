"""The Rerun recording of a run. Importing this package imports rerun, so import it where it is needed."""

import os

# A failure comes as RunError; rerun's own log lines on standard error would only repeat it.
os.environ.setdefault("RUST_LOG", "off")

from testbed.recording.writer import RecordingWriter

__all__ = ["RecordingWriter"]
