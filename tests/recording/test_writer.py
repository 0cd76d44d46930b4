from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections import defaultdict
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pytest
import rerun as rr
from rerun.chunk import RrdReader

from testbed.errors import RunError
from testbed.units import DEG, PER_RATE

N_TIME = 47_003  # 2.35 s: no multiple of a block, of a bin (12 samples) or of the pose stride
DETAIL = (20_000, 25_000)  # base samples of the window (1 s, 1.25 s), its end included


@pytest.fixture(scope="module", autouse=True)
def strict():
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(False)


@pytest.fixture(scope="module")
def run(synthetic_run):
    return synthetic_run(N_TIME)


@pytest.fixture(scope="module")
def recording(run, tmp_path_factory):
    return run.record(tmp_path_factory.mktemp("recording") / "recording.rrd")


def read(path):
    """Every time column of the file: {(entity, component): (time in ns, flat values)}, rows in the order of time."""
    found = defaultdict(list)
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        if "sim_time" not in batch.schema.names:
            continue
        times = batch.column("sim_time").to_numpy(zero_copy_only=False)
        for name in batch.schema.names:
            if ":" in name:
                values = batch.column(name).flatten()
                while not hasattr(values, "to_numpy") or values.type.num_fields:
                    values = values.flatten()
                found[chunk.entity_path, name].append((times, values.to_numpy(zero_copy_only=False)))
    merged = {}
    for key, parts in found.items():
        parts.sort(key=lambda part: part[0][0])
        merged[key] = tuple(np.concatenate(column) for column in zip(*parts, strict=True))
    return merged


def scalars(path):
    return {entity: rows for (entity, name), rows in read(path).items() if name == "Scalars:scalars"}


def sources(run, factor=PER_RATE["deg/s"]):
    """Entity -> (stride, the array that the chain produced, in the unit of the recording)."""
    powers = {"R_mhd_ars": 2, "innovation_mems_gyro": 1, "band_mhd_ars": 0}
    found = {
        entity: (stride, factor ** powers.get(entity.rpartition("/")[2], 1) * values)
        for entity, (stride, values) in produced(run).items()
    }
    for name in run.filters:
        found[f"/fusion/{name}/log10_R_mhd_ars"] = 1, np.log10(found[f"/fusion/{name}/R_mhd_ars"][1])
    return found


def produced(run):
    """Entity -> (stride, the array that the chain produced [SI])."""
    expected = {
        "/commanded/rate": (1, run.commanded[:-1]),
        "/truth/rate": (1, run.truth),
        "/sensors/mhd_ars/rate": (1, run.readings["mhd_ars"]),
        "/sensors/mems_gyro/rate": (10, run.readings["mems_gyro"]),
    }
    for name, rate in run.estimates.items():
        expected[f"/fusion/{name}/rate"] = (1, rate)
        expected[f"/fusion/{name}/error"] = (1, rate - run.truth)
        expected[f"/fusion/{name}/std"] = (1, np.full(N_TIME, 1e-4))
        expected |= {f"/fusion/{name}/{key}": (1, values) for key, values in run.diagnostics.items()}
    return expected


@pytest.mark.contract
def test_recording_has_the_entities_of_the_contract(run, recording):
    schema = RrdReader(recording).store().schema()
    expected = {*sources(run), "/world/platform", "/world/rotor", "/world/rotor/sites/mhd_ars"}
    expected |= {f"/sensors/mhd_ars/channel/{part}" for part in ("profile", "velocity")}
    assert expected <= set(schema.entity_paths())
    assert [column.name for column in schema.index_columns()] == ["sim_time"]


@pytest.mark.contract
def test_recording_embeds_its_layout(recording):
    reader = RrdReader(recording)
    assert [entry.application_id for entry in reader.recordings()] == ["testbed"]
    classes = set()
    for chunk in reader.stream(store=reader.blueprints()[0]):
        batch = chunk.to_record_batch()
        if "ViewBlueprint:class_identifier" in batch.schema.names:
            classes |= set(batch.column("ViewBlueprint:class_identifier").flatten().to_pylist())
    assert classes == {"3D", "2D", "TimeSeries"}


def test_every_recorded_sample_is_a_sample_of_its_source_bit_for_bit(run, recording):
    rows = scalars(recording)
    for entity, (stride, values) in sources(run).items():
        times, recorded = rows[entity]
        assert times.dtype == "timedelta64[ns]"
        # 20 kHz divides 1 s into whole nanoseconds: the index is exact.
        index, rest = np.divmod(times.astype(np.int64), 50_000 * stride)
        assert not rest.any(), entity
        assert np.array_equal(recorded, values[index]), entity
        assert np.all(np.diff(index) > 0), entity


def test_slow_rates_are_in_degrees_per_hour_everywhere(run, tmp_path):
    """Each value by the same product, and no word in the file that names another unit of a rate."""
    path = run.record(tmp_path / "slow.rrd", unit="deg/h")
    rows = scalars(path)
    for entity, (stride, values) in sources(run, PER_RATE["deg/h"]).items():
        times, recorded = rows[entity]
        assert np.array_equal(recorded, values[times.astype(np.int64) // (50_000 * stride)]), entity
    assert rows["/fusion/kalman/std"][1].max() == pytest.approx(1e-4 / DEG * 3600.0)


@pytest.mark.parametrize("unit", ["deg/s", "deg/h"])
def test_every_name_and_title_says_the_unit_of_the_run(run, tmp_path, unit):
    reader = RrdReader(run.record(tmp_path / "named.rrd", unit=unit))
    said = set()
    for stream in (reader.stream(), reader.stream(store=reader.blueprints()[0])):
        for chunk in stream:
            said |= set(words_of(chunk.to_record_batch()))
    named = {word for word in said if re.search(r"[a-z]/[sh]\b", word)}
    assert {
        f"Error of kalman [{unit}]",
        f"Rate, whole run [{unit}]",
        f"Adapted R, mhd_ars [log10 of ({unit})²]",
    } <= named
    assert all(unit in word for word in named)


def words_of(batch):
    """Yield every text of a batch."""
    for column in batch.columns:
        values = column
        while hasattr(values, "flatten") and pa.types.is_nested(values.type) and not pa.types.is_struct(values.type):
            values = values.flatten()
        if pa.types.is_string(values.type):
            yield from filter(None, values.to_pylist())


def test_first_and_last_sample_are_recorded(run, recording):
    rows = scalars(recording)
    for entity, (stride, values) in sources(run).items():
        finite = np.flatnonzero(np.isfinite(values)) * stride * 50_000
        times = rows[entity][0].astype(np.int64)
        assert (times[0], times[-1]) == (finite[0], finite[-1]), entity


def test_detail_window_has_every_sample_of_rates_and_errors(run, recording):
    rows = scalars(recording)
    for entity, (stride, values) in sources(run).items():
        if entity.endswith(("/rate", "/error")):
            index = np.arange(-(-DETAIL[0] // stride), DETAIL[1] // stride + 1)
            times, recorded = rows[entity]
            inside = (times.astype(np.int64) >= DETAIL[0] * 50_000) & (times.astype(np.int64) <= DETAIL[1] * 50_000)
            assert np.array_equal(recorded[inside], values[index]), entity


def test_detail_window_is_by_default_the_two_seconds_after_settle(run, tmp_path):
    times = scalars(run.record(tmp_path / "default.rrd", settle=0.2, detail=None))["/truth/rate"][0].astype(np.int64)
    inside = times[(times >= 200_000_000) & (times <= 2_200_000_000)]
    assert np.array_equal(inside, np.arange(4_000, 44_001) * 50_000)
    assert times.size < 44_001  # less than all before and behind it


def test_spikes_of_one_sample_survive_outside_the_window(synthetic_run, tmp_path):
    run = synthetic_run(N_TIME)
    run.estimates["kalman"][31_415] += 1.0
    run.readings["mems_gyro"][3_333] -= 1.0
    rows = scalars(run.record(tmp_path / "spikes.rrd"))
    per = PER_RATE["deg/s"]
    assert per * run.estimates["kalman"][31_415] in rows["/fusion/kalman/rate"][1]
    assert per * (run.estimates["kalman"][31_415] - run.truth[31_415]) in rows["/fusion/kalman/error"][1]
    assert per * run.readings["mems_gyro"][3_333] in rows["/sensors/mems_gyro/rate"][1]


@pytest.mark.parametrize("size", [2_000, 777, 47_003])
def test_block_size_does_not_change_the_recording(run, recording, tmp_path, size):
    whole, pieces = read(recording), read(run.record(tmp_path / "pieces.rrd", size))
    assert whole.keys() == pieces.keys()
    for key, (times, values) in whole.items():
        assert np.array_equal(times, pieces[key][0]), key
        assert np.array_equal(values, pieces[key][1]), key


def test_poses_have_the_scalar_part_of_the_quaternion_last(run, recording):
    rows = read(recording)
    times, quaternion = rows["/world/rotor", "Transform3D:quaternion"]
    assert np.array_equal(times.astype(np.int64), run.index * 50_000)
    w, x, y, z = run.poses["rotor"][1].astype(np.float32).T
    assert np.array_equal(quaternion.reshape(-1, 4), np.column_stack((x, y, z, w)))
    _, translation = rows["/world/rotor", "Transform3D:translation"]
    assert np.array_equal(translation.reshape(-1, 3), run.poses["rotor"][0].astype(np.float32))


def test_needle_turns_by_a_multiple_of_the_angle(run, recording):
    _, quaternion = read(recording)["/world/dial/needle", "Transform3D:quaternion"]
    turned = 2 * np.arctan2(*quaternion.reshape(-1, 4)[:, [2, 3]].T)
    # Largest angle 11.1 mrad: the dial ends at 12 mrad, and 50 x 12 mrad is the last multiple within its 40 deg.
    # A quaternion in float32 has an angle to 2 * 2**-24 / cos(20 deg).
    np.testing.assert_allclose(turned, 50 * run.angle[run.index], atol=2e-7)


def test_profiles_and_heights_are_those_of_the_channel(run, recording):
    rows = read(recording)
    _, strips = rows["/sensors/mhd_ars/channel/profile", "LineStrips2D:strips"]
    points = strips.reshape(run.index.size, run.heights.size, 2)
    profiles = PER_RATE["deg/s"] * run.profiles
    assert np.array_equal(points[..., 0], profiles.astype(np.float32))
    assert np.array_equal(points[..., 1], np.tile(run.heights.astype(np.float32), (run.index.size, 1)))
    times, velocity = rows["/sensors/mhd_ars/channel/velocity", "Scalars:scalars"]
    assert np.array_equal(times.astype(np.int64), run.index * 50_000)
    probes = [np.abs(run.heights - share * 15e-3).argmin() for share in (1 / 32, 1 / 8, 1 / 2)]
    assert np.array_equal(velocity.reshape(-1, 3), profiles[:, probes])


def test_lines_are_drawn_by_their_extremes_in_explicit_colors(run, recording):
    """The viewer's default policy draws the mean, which is a flat line for a fast sine."""
    styles = defaultdict(dict)
    for chunk in RrdReader(recording).stream():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            if name.startswith("SeriesLines:"):
                styles[chunk.entity_path][name.split(":")[1]] = batch.column(name).flatten().to_pylist()
    assert set(sources(run)) <= set(styles)
    for entity, style in styles.items():
        assert style["aggregation_policy"] == [rr.components.AggregationPolicy.MinMax.value], entity
        assert style["colors"], entity


def test_time_is_exact_at_rates_that_do_not_divide_a_nanosecond(synthetic_run, tmp_path):
    run = synthetic_run(20_000)
    path = run.record(
        tmp_path / "odd.rrd",
        sample_rate_hz=30_000.0,
        sensor_rates={"mhd_ars": 30e3, "mems_gyro": 3e3},
        detail=(0.0, 0.6),
        settle=0.0,
    )
    times, values = scalars(path)["/truth/rate"]
    # Stamps are the nearest nanosecond: (k 1e9 / 30 000) in whole numbers.
    expected = [(k * 1_000_000_000 * 2 + 30_000) // (2 * 30_000) for k in range(18_001)]
    assert np.array_equal(times[:18_001].astype(np.int64), expected)
    assert np.array_equal(values[:18_001], PER_RATE["deg/s"] * run.truth[:18_001])


def test_writer_that_fails_leaves_no_file(run, tmp_path):
    path = tmp_path / "aborted.rrd"

    def interrupted():
        with run.writer(path) as writer:
            writer.write(next(run.blocks(1000)))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert not path.exists()


def test_closing_twice_is_allowed(run, tmp_path):
    with run.writer(tmp_path / "twice.rrd") as writer:
        for block in run.blocks(20_000):
            writer.write(block)
        writer.close()
    assert RrdReader(tmp_path / "twice.rrd").store() is not None


@pytest.mark.parametrize("size", [777, 20_000])
def test_estimates_at_the_rate_of_a_slow_sensor_meet_the_truth_of_their_instants(synthetic_run, tmp_path, size):
    run = synthetic_run(N_TIME, filters=("kalman",))
    with run.writer(tmp_path / "slow.rrd", sensor_rates={"mems_gyro": 2e3}, detail=(0.0, 3.0)) as writer:
        for block in run.blocks(size):
            due = slice(-block.start % 10, None, 10)
            del block.sensors["mhd_ars"]
            kalman = block.fusion["kalman"]
            kalman.rate, kalman.std, kalman.diagnostics = kalman.rate[due], kalman.std[due], {}
            block.profiles = {}
            writer.write(block)
    times, error = scalars(tmp_path / "slow.rrd")["/fusion/kalman/error"]
    assert np.array_equal(times.astype(np.int64), np.arange(0, N_TIME, 10) * 50_000)
    assert np.array_equal(error, PER_RATE["deg/s"] * (run.estimates["kalman"] - run.truth)[::10])


def test_run_without_filters_or_sensors_is_recorded(synthetic_run, tmp_path):
    run = synthetic_run(5_000, filters=())
    with run.writer(tmp_path / "bare.rrd", sensor_rates={}) as writer:
        for block in run.blocks(5_000):
            block.sensors, block.fusion, block.profiles = {}, {}, {}
            writer.write(block)
    assert set(scalars(tmp_path / "bare.rrd")) == {"/commanded/rate", "/truth/rate"}


def test_missing_folder_is_a_run_error_that_names_the_file(run, tmp_path):
    path = tmp_path / "nowhere" / "recording.rrd"
    with pytest.raises(RunError, match=r"nowhere/recording\.rrd: the recording could not be written"):
        run.writer(path)


@pytest.mark.skipif(sys.platform != "linux" or shutil.which("unshare") is None, reason="needs Linux and unshare")
def test_full_disk_is_a_run_error_that_names_the_file(tmp_path):
    # A file system of 1 MB in a mount namespace of its own; the run's recording is several MB.
    program = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from conftest import SyntheticRun
from testbed.errors import RunError
from testbed.units import DEG, PER_RATE
run = SyntheticRun(47_003)
try:
    run.record(Path(sys.argv[1]) / "recording.rrd", detail=(0.0, 2.0))
except RunError as error:
    print("RunError", error)
"""
    here = __file__.rsplit("/", 1)[0]
    mounted = f'mount -t tmpfs -o size=1m none "{tmp_path}" && exec "$0" "$@"'
    arguments = ["unshare", "-rm", "sh", "-c", mounted, sys.executable, "-c", program, str(tmp_path), here]
    done = subprocess.run(arguments, capture_output=True, text=True, check=False, timeout=120)
    if "mount" in done.stderr or "unshare" in done.stderr:
        pytest.skip(f"no mount namespace here: {done.stderr.strip()}")
    assert "RunError" in done.stdout, done.stderr
    assert done.stderr == "", "the library's own log would only repeat it"
    assert "recording.rrd: the recording could not be written (its disk is full: 0.0 MB free)" in done.stdout


def test_lost_readings_are_marked_and_readings_that_were_not_due_are_not(synthetic_run, tmp_path):
    """In the window each lost reading, elsewhere each bin without one; of a diagnostic nothing."""
    run = synthetic_run(40_000)
    lost = np.zeros(run.n_time, bool)
    lost[21_000:21_500], lost[30_000:33_000] = True, True
    run.readings["mhd_ars"][lost] = np.nan
    rows = scalars(run.record(tmp_path / "recording.rrd"))
    times, recorded = rows["/sensors/mhd_ars/rate"]
    index = times[np.isnan(recorded)].astype(np.int64) // 50_000
    # The window is 1 to 1.25 s, samples 20 000 to 25 000; a bin holds ten of the 40 000.
    assert index.tolist() == [*range(21_000, 21_500), *range(30_000, 33_000, 10)]
    assert not np.isnan(rows["/fusion/kalman/innovation_mems_gyro"][1]).any()


def test_a_profile_below_the_resolution_draws_no_axes_of_its_own(tmp_path, recwarn):
    """At standstill the fluid's velocity is arithmetic, 1e-90 rad/s: its scale would overflow single precision."""
    from testbed.recording.channel import Channel
    from testbed.recording.stream import Recording

    calls = []
    recording = Recording(SimpleNamespace(log=lambda *args, **_: calls.append(args)), None)
    channel = Channel.__new__(Channel)
    channel._unit = "deg/s"
    channel._full = 0.0
    channel._largest, channel._heights, channel._color = 1e-90, np.array([0.0, 1e-3]), "#2f86d6"
    channel._recording, channel.entity = recording, "/sensors/mhd_ars/channel"
    channel._batch = SimpleNamespace(flush=lambda: None)
    channel.finish()
    assert calls
    assert not recwarn.list
