"""A recording that is watched while it is written: the viewer has it, the file is whole, and a window may be closed."""

from __future__ import annotations

import os
import sys
import time

import numpy as np
import pytest
from rerun.chunk import RrdReader

from testbed.errors import RunError
from testbed.pages.palette import TRUTH
from testbed.recording.viewer import headless_viewer, live_window
from tests.cli.test_grammar import say
from tests.recording.test_picture import covered, picture_of, pixels
from tests.scenes import short_file

SIZE = (1200, 800)


@pytest.fixture
def client():
    try:
        with headless_viewer(SIZE) as started:
            yield started
    except RunError as error:
        if not any(reason in str(error) for reason in ("graphics adapter", "render context")):
            raise
        pytest.skip(f"no Vulkan driver for the headless viewer (Debian: mesa-vulkan-drivers): {error}")


def rows(path, entity):
    """Return the values of a scalar, in order of time."""
    parts = []
    for chunk in RrdReader(path).stream():
        if chunk.entity_path == entity and not chunk.is_static:
            batch = chunk.to_record_batch()
            time = batch.column("sim_time").to_numpy().astype(np.int64)
            parts.append(np.column_stack([time, batch.column("Scalars:scalars").flatten().to_numpy()]))
    found = np.vstack(parts)
    return found[np.argsort(found[:, 0], kind="stable")]


def seen_until(client, wanted, most=10.0):
    """Return up to when the viewer has the recording [s], once that is as far as wanted, or after so many seconds."""
    begun = time.monotonic()
    while True:
        (line,) = (one for one in client.get_state().recordings[-1].timelines if one.name == "sim_time")
        if line.end / 1e9 >= wanted or time.monotonic() - begun > most:
            return line.end / 1e9
        time.sleep(0.02)


@pytest.mark.slow
def test_the_viewer_sees_each_block_and_the_file_is_that_of_a_run_unwatched(client, synthetic_run, tmp_path):
    run = synthetic_run(60_000, filters=("kalman",))
    with run.writer(tmp_path / "live.rrd", live=str(client.url)) as writer:
        for k, block in enumerate(run.blocks(20_000)):
            writer.write(block)
            writer._stream.flush(timeout_sec=10)
            # Of the last block the open bin is held back: 15 samples of 50 us, and at most a pose's 20 ms.
            assert seen_until(client, k + 0.97) == pytest.approx(k + 1.0, abs=0.03)
        rows_, columns = covered(pixels(picture_of(client, "Rate, whole run [deg/s]")), TRUTH)
        assert rows_ > 0.2
        assert columns > 0.2
    run.record(tmp_path / "alone.rrd")
    for entity in ("/truth/rate", "/sensors/mems_gyro/rate", "/fusion/kalman/error"):
        assert np.array_equal(rows(tmp_path / "live.rrd", entity), rows(tmp_path / "alone.rrd", entity))


def needle(path):
    """Return the angle of the needle at each instant as the viewer has it: of two, the one that came last."""
    found = {}
    for chunk in RrdReader(path).stream():
        if chunk.entity_path == "/world/dial/needle" and not chunk.is_static:
            batch = chunk.to_record_batch()
            ids = batch.column(0).to_pylist()
            turns = np.array(batch.column("Transform3D:quaternion").flatten().flatten().to_numpy()).reshape(-1, 4)
            for time, row, turn in zip(batch.column("sim_time").to_pylist(), ids, turns, strict=True):
                found[time] = max(found.get(time, (b"", 0.0)), (row, 2 * np.arctan2(turn[2], turn[3])))
    return np.array([found[time][1] for time in sorted(found)])


@pytest.mark.slow
def test_needle_and_channel_are_seen_while_it_runs_and_end_in_the_same_scale(client, synthetic_run, tmp_path):
    """The table turns ever further: the dial of the first second is another than that of the last."""
    run = synthetic_run(60_000, filters=("kalman",))
    run.angle = 1e-3 * np.arange(run.n_time) / run.n_time
    scales = []
    with run.writer(tmp_path / "live.rrd", live=str(client.url)) as writer:
        for block in run.blocks(10_000):
            writer.write(block)
            scales.append((writer._world._scale, writer._channels["mhd_ars"]._full))
    assert len({dial for dial, _ in scales}) > 2
    assert all(full > 0.0 for _, full in scales)
    run.record(tmp_path / "alone.rrd")
    np.testing.assert_array_equal(needle(tmp_path / "live.rrd"), needle(tmp_path / "alone.rrd"))


@pytest.mark.slow
def test_a_window_that_is_closed_costs_nothing_of_the_file(synthetic_run, tmp_path, capfd):
    run = synthetic_run(60_000, filters=("kalman",))
    blocks = list(run.blocks(20_000))
    try:
        with headless_viewer(SIZE) as client:
            writer = run.writer(tmp_path / "live.rrd", live=str(client.url))
            writer.write(blocks[0])
    except RunError as error:
        pytest.skip(f"no viewer: {error}")
    for block in blocks[1:]:
        writer.write(block)
    writer.close()
    run.record(tmp_path / "alone.rrd")
    assert np.array_equal(rows(tmp_path / "live.rrd", "/truth/rate"), rows(tmp_path / "alone.rrd", "/truth/rate"))


@pytest.mark.skipif(sys.platform != "linux", reason="asks for DISPLAY")
def test_without_a_display_it_is_refused_before_anything_runs(monkeypatch, capsys, tmp_path):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(RunError, match="--live: expected a display"), live_window():
        pass
    path = short_file(tmp_path)
    status, _, told = say(
        "run", str(path), "--live", "--out", str(tmp_path / "x"), monkeypatch=monkeypatch, capsys=capsys
    )
    assert status == 3
    assert "expected a display" in told
    assert not os.path.lexists(tmp_path / "x")
    status, _, told = say("run", str(path), "--live", "--outputs", "metrics", monkeypatch=monkeypatch, capsys=capsys)
    assert status == 2
    assert "--live shows the recording: add recording" in told
