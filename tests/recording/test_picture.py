"""The recording as the viewer draws it: pixels of colours that were set explicitly."""

from __future__ import annotations

import io
import socket

import matplotlib.image
import numpy as np
import psutil
import pytest

from testbed.errors import RunError
from testbed.pages.palette import COMMANDED, FILTERS, SENSORS, TRUTH, rgb
from testbed.recording.viewer import headless_viewer, screenshot, settled_picture, show

FAST_HZ = 4900.0  # several periods in each column of pixels of the 0.5 s that are shown
SIZE = (1600, 900)


@pytest.fixture(scope="module")
def viewer():
    try:
        with headless_viewer(SIZE) as client:
            yield client
    except RunError as error:
        if not any(reason in str(error) for reason in ("graphics adapter", "render context")):
            raise
        pytest.skip(f"no Vulkan driver for the headless viewer (Debian: mesa-vulkan-drivers): {error}")


@pytest.fixture(scope="module")
def run(synthetic_run):
    """12 s whose only error is a sine that no screen can resolve."""
    run = synthetic_run(240_000, filters=("kalman",))
    t = np.arange(run.n_time) / 20e3
    run.estimates["kalman"] = run.truth + 1e-3 * np.sin(2 * np.pi * FAST_HZ * t)
    return run


@pytest.fixture(scope="module")
def recording(run, tmp_path_factory):
    return run.record(tmp_path_factory.mktemp("picture") / "recording.rrd", settle=6.0, detail=(6.0, 8.0))


@pytest.fixture(scope="module")
def shown(viewer, recording):
    show(viewer, recording, 6.2)
    return viewer


def picture_of(client, name):
    """Return a settled PNG of the view of that name."""
    (view,) = (view.view_id for view in client.get_state().views if view.name == name)
    return settled_picture(client, lambda: client.take_screenshot(view))


def pixels(png):
    return np.round(matplotlib.image.imread(io.BytesIO(png))[..., :3] * 255).astype(int)


def covered(image, color):
    """Share of rows and share of columns that have at least one pixel of exactly this colour."""
    hit = (image == rgb(color)).all(axis=-1)
    return hit.any(axis=1).mean(), hit.any(axis=0).mean()


def test_layout_opens_with_its_views_and_without_complaint(shown):
    views = {view.name: view for view in shown.get_state().views}
    assert {"Turntable", "Fluid velocity profile, mhd_ars", "Rate, whole run [deg/s]"} <= views.keys()
    assert {"Error of kalman [deg/s]", "Rate ±50 ms at the cursor [deg/s]"} <= views.keys()
    assert [report for view in views.values() for report in view.reports] == []
    recording = shown.get_state().recordings[0]
    assert recording.current_timeline == "sim_time"
    assert [(line.name, line.time_type) for line in recording.timelines] == [("sim_time", "duration")]


def test_fast_oscillation_is_drawn_with_its_amplitude(shown):
    """A mean of neighbouring samples, the viewer's default, would be a flat line at zero."""
    rows, columns = covered(pixels(picture_of(shown, "Error of kalman [deg/s]")), FILTERS[0])
    # The plot leaves a margin below for the axis, on the left for its numbers, and 5 % above and below the data.
    assert rows > 0.6
    assert columns > 0.6


def test_detail_shows_all_rates_in_their_colors(shown):
    image = pixels(picture_of(shown, "Rate, every sample from 6 to 6.5 s [deg/s]"))
    for color in (SENSORS[0], SENSORS[1], FILTERS[0], TRUTH):
        rows, columns = covered(image, color)
        assert rows > 0.2, color
        # Lines lie upon each other: of the one drawn first only what sticks out is left.
        assert columns > 0.1, color
    # Commanded lies under the others; its legend is seen at least.
    assert covered(image, COMMANDED)[0] > 0.0


def test_lost_readings_are_a_gap_in_the_line(viewer, synthetic_run, tmp_path):
    """Every reading from 6.2 to 6.3 s is lost: a fifth of the 0.5 s that are shown has no line, the rest has."""
    run = synthetic_run(240_000, filters=("kalman",))
    run.readings["mhd_ars"] = np.full(run.n_time, 0.03)  # above all others
    run.readings["mhd_ars"][124_000:126_000] = np.nan
    show(viewer, run.record(tmp_path / "gap.rrd", settle=6.0, detail=(6.0, 8.0)), 6.2)
    image = pixels(picture_of(viewer, "Rate, every sample from 6 to 6.5 s [deg/s]"))
    blue = image[..., 2] - image[..., 0] > 40  # its edges are mixed with the background
    drawn = np.flatnonzero(blue[blue.sum(axis=1).argmax()])  # the row of pixels of the line, not of the legend
    steps, span = np.diff(drawn), np.ptp(drawn)
    assert steps.max() / span == pytest.approx(0.2, abs=0.02)
    assert np.sort(steps)[-2] / span < 0.02


def test_fluid_profile_fills_the_height_of_the_channel(shown):
    image = pixels(picture_of(shown, "Fluid velocity profile, mhd_ars"))
    rows, columns = covered(image, SENSORS[0])
    # The channel takes 90 of the 131.6 units of the view's height.
    assert 0.45 < rows < 0.7
    assert columns > 0.01


def test_turntable_and_its_sensor_are_seen(shown):
    image = pixels(picture_of(shown, "Turntable"))
    # The disc is a bluish grey (184, 191, 199), shaded; slab and background are darker.
    lit = (np.ptp(image, axis=-1) < 30) & (image.min(axis=-1) > 110)
    assert lit.mean() > 0.05
    assert covered(image, SENSORS[0])[0] > 0.0, "label or leader of mhd_ars"


def test_viewer_listens_on_loopback_only(viewer):
    ours = psutil.Process().children(recursive=True)
    ends = [c.laddr.ip for p in ours if "rerun" in p.name() for c in p.net_connections() if c.status == "LISTEN"]
    assert ends
    assert set(ends) == {"127.0.0.1"}


def test_file_that_is_no_recording_is_named(viewer, tmp_path):
    bad = tmp_path / "bad.rrd"
    bad.write_bytes(b"RRF2 and then nothing of use")
    with pytest.raises(RunError, match=r"bad\.rrd: the viewer could not open it"):
        show(viewer, bad, 0.0)


@pytest.mark.slow
def test_screenshot_writes_the_window_and_ends_its_viewer(viewer, recording, tmp_path):
    before = set(psutil.Process().children(recursive=True))
    screenshot(recording, tmp_path / "window.png", at=6.2, size=(1200, 700))
    image = pixels((tmp_path / "window.png").read_bytes())
    assert image.shape == (700, 1200, 3)
    assert covered(image, FILTERS[0])[1] > 0.2
    left = {p for p in set(psutil.Process().children(recursive=True)) - before if p.status() != psutil.STATUS_ZOMBIE}
    assert left == set()


def test_viewer_ends_with_its_block(viewer):
    with headless_viewer((400, 300)) as client:
        port = int(str(client.url).split(":")[-1].split("/")[0])
    with socket.socket() as probe:
        assert probe.connect_ex(("127.0.0.1", port)) != 0
