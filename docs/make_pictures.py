"""Draw the picture of a recording that the README shows: `python docs/make_pictures.py RUN_DIR`."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import matplotlib.image

from testbed.recording.viewer import RECORDING, screenshot

PICTURE = Path(__file__).parent / "images" / "recording.png"
MENU = 36  # points; the viewer's own menu bar says nothing about the run
CURSOR = 10.32  # s; a third of a second behind the settling time of the mixed scenario


def main() -> None:
    """Draw the recording of the run folder named on the command line."""
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    with tempfile.TemporaryDirectory() as folder:
        window = Path(folder) / "window.png"
        screenshot(Path(sys.argv[1]) / RECORDING, window, at=CURSOR, size=(1800, 1036))
        PICTURE.parent.mkdir(exist_ok=True)
        matplotlib.image.imsave(PICTURE, matplotlib.image.imread(window)[MENU:])


if __name__ == "__main__":
    main()
