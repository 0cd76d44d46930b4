"""Draw the pictures of the README: `python docs/make_pictures.py RUN_DIR`, a run of the mixed scenario."""

from __future__ import annotations

import runpy
import sys
import tempfile
from pathlib import Path

import matplotlib as mpl
import matplotlib.image

from testbed.recording.viewer import RECORDING, screenshot

IMAGES = Path(__file__).parent / "images"
CURVES = Path(__file__).parents[1] / "examples" / "gallery" / "plot_error_over_frequency.py"
MENU = 36  # points; the viewer's own menu bar says nothing about the run
CURSOR = 10.32  # s; a third of a second behind the settling time of the mixed scenario


def draw_recording(run: Path) -> None:
    """Draw the window of the viewer with a run's recording."""
    with tempfile.TemporaryDirectory() as folder:
        window = Path(folder) / "window.png"
        screenshot(run / RECORDING, window, at=CURSOR, size=(1800, 1036))
        matplotlib.image.imsave(IMAGES / "recording.png", matplotlib.image.imread(window)[MENU:])


def draw_curves() -> None:
    """Draw what the gallery's script draws of the error against frequency."""
    mpl.use("agg")
    runpy.run_path(str(CURVES))["figure"].savefig(IMAGES / "error_over_frequency.png", dpi=140)


def main() -> None:
    """Draw both."""
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    IMAGES.mkdir(exist_ok=True)
    draw_recording(Path(sys.argv[1]))
    draw_curves()


if __name__ == "__main__":
    main()
