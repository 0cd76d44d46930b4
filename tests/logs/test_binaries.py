"""Binary formats give the samples that were written into them; a wrong name does not matter, damage is named."""

from __future__ import annotations

import contextlib
import io
import json
import struct
import sys

import numpy as np
import pytest

from testbed.errors import ScenarioError
from testbed.judging.allan_analysis import analyse
from testbed.judging.allan_records import read
from testbed.logs import read_log
from testbed.logs.selection import Selection
from tests.logs.kinds import COUNTS, EPOCH_NS, FS, RATE, TIME_US, N

SECONDS = TIME_US / 1e6


def mat5(path):
    from scipy.io import savemat

    savemat(path, {"t": SECONDS, "rate": RATE}, do_compression=True)


def mat5_struct(path):
    from scipy.io import savemat

    savemat(path, {"imu": {"time": SECONDS[:, None], "gyro": np.stack([RATE, RATE / 2, RATE / 3], axis=1)}, "fs": FS})


def mat73(path):
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        file["t"] = SECONDS[None, :]
        file["gyro"] = np.stack([RATE, 2 * RATE])
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file".ljust(512))


def hdf5(path):
    import h5py

    with h5py.File(path, "w") as file:
        data = file.create_dataset("imu/w", data=RATE.astype(np.float32), compression="gzip")
        data.attrs["units"] = "deg/s"
        file.create_dataset("imu/stamp", data=EPOCH_NS + 1000 * TIME_US).attrs["units"] = "ns"
        file["other/w"] = np.zeros(7)


def hdf5_records(path):
    import h5py

    rows = np.zeros(RATE.size, dtype=[("t", "i8"), ("w", "f8")])
    rows["t"], rows["w"] = TIME_US, RATE
    with h5py.File(path, "w") as file:
        file["log"] = rows


def netcdf4(path):
    import h5netcdf

    with h5netcdf.File(path, "w") as file:
        file.dimensions = {"time": RATE.size}
        file.create_variable("time", ("time",), data=SECONDS).attrs["units"] = "seconds since 2024-01-01 00:00:00"
        packed = file.create_variable("w", ("time",), data=COUNTS.astype(np.int16))
        packed.attrs["units"], packed.attrs["scale_factor"] = "deg/s", 0.002


def netcdf3(path):
    from scipy.io import netcdf_file

    with netcdf_file(path, "w") as file:
        file.createDimension("time", RATE.size)
        for name, values, unit in (("time", SECONDS, "s"), ("w", RATE, "deg/s")):
            variable = file.createVariable(name, "d", ("time",))
            variable[:], variable.units = values, unit


def npy(path):
    buffer = io.BytesIO()
    np.save(buffer, RATE)
    path.write_bytes(buffer.getvalue())


def npz(path):
    buffer = io.BytesIO()
    np.savez_compressed(buffer, t_us=TIME_US, w=np.deg2rad(RATE), fs=FS)
    path.write_bytes(buffer.getvalue())


def parquet(path):
    import pyarrow as pa
    from pyarrow import parquet as pq

    stamps = pa.array(EPOCH_NS + 1000 * TIME_US, pa.timestamp("ns"))
    table = pa.table({"stamp": stamps, "w [deg/s]": RATE, "note": ["x"] * RATE.size})
    pq.write_table(table, path, row_group_size=1500)


def feather(path):
    import pyarrow as pa
    from pyarrow import feather as fe

    fe.write_feather(pa.table({"t_s": SECONDS, "w_dps": RATE}), str(path))


def mdf(path):
    asammdf = pytest.importorskip("asammdf")
    file = asammdf.MDF(version="4.10")
    file.append([asammdf.Signal(RATE, SECONDS, name="w", unit="deg/s")])
    file.append([asammdf.Signal(RATE[:50], SECONDS[:50], name="temperature", unit="degC")])
    file.save(path.with_suffix(".mf4"), overwrite=True)
    path.with_suffix(".mf4").rename(path)


def tdms(path):
    nptdms = pytest.importorskip("nptdms")
    said = {"wf_increment": 1.0 / FS, "unit_string": "deg/s"}
    with nptdms.TdmsWriter(str(path)) as file:
        file.write_segment([nptdms.ChannelObject("bench", "w", RATE, properties=said)])


def ros2(path, plugin="MCAP", suffix="mcap"):
    rosbags = pytest.importorskip("rosbags.rosbag2")
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds = store.types
    vector = kinds["geometry_msgs/msg/Vector3"]
    folder = path.parent / f"bag_{suffix}"
    with rosbags.Writer(folder, version=9, storage_plugin=getattr(rosbags.StoragePlugin, plugin)) as writer:
        connection = writer.add_connection("/imu", "sensor_msgs/msg/Imu", typestore=store)
        for t, w in zip((EPOCH_NS + 1000 * TIME_US).tolist(), np.deg2rad(RATE).tolist(), strict=True):
            stamp = kinds["builtin_interfaces/msg/Time"](sec=t // 10**9, nanosec=t % 10**9)
            message = kinds["sensor_msgs/msg/Imu"](
                header=kinds["std_msgs/msg/Header"](stamp=stamp, frame_id="imu"),
                orientation=kinds["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
                orientation_covariance=np.zeros(9),
                angular_velocity=vector(x=w, y=0.0, z=0.0),
                angular_velocity_covariance=np.zeros(9),
                linear_acceleration=vector(x=0.0, y=0.0, z=9.8),
                linear_acceleration_covariance=np.zeros(9),
            )
            writer.write(connection, t, store.serialize_cdr(message, "sensor_msgs/msg/Imu"))
    next(folder.glob(f"*.{suffix}")).rename(path)


def ros2_sqlite(path):
    ros2(path, "SQLITE3", "db3")


def mcap_json(path):
    writer_of = pytest.importorskip("mcap.writer")
    with path.open("wb") as stream:
        writer = writer_of.Writer(stream)
        writer.start()
        schema = writer.register_schema("gyro", "jsonschema", b"{}")
        channel = writer.register_channel("/gyro", "json", schema)
        for t, w in zip(TIME_US.tolist(), RATE.tolist(), strict=True):
            writer.add_message(channel, 1000 * t, json.dumps({"w_dps": w}).encode(), 1000 * t)
        writer.finish()


def ulog(path):
    """Return a log as PX4 writes it: definitions, a subscription, then rows."""
    pytest.importorskip("pyulog")

    def message(kind, content):
        return struct.pack("<HB", len(content), ord(kind)) + content

    fields = b"sensor_gyro:uint64_t timestamp;uint64_t timestamp_sample;float x;uint8_t samples;"
    parts = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0), message("F", fields)]
    parts.append(message("A", struct.pack("<BH", 0, 7) + b"sensor_gyro"))
    for t, w in zip(TIME_US.tolist(), np.deg2rad(RATE).tolist(), strict=True):
        parts.append(message("D", struct.pack("<HQQfB", 7, t + 400 + t % 37, t + 9, w, 1)))
    path.write_bytes(b"".join(parts))


def ulog_fifo(path):
    pytest.importorskip("pyulog")

    def message(kind, content):
        return struct.pack("<HB", len(content), ord(kind)) + content

    fields = (
        b"sensor_gyro_fifo:uint64_t timestamp;uint64_t timestamp_sample;uint32_t device_id;float dt;float scale;"
        b"uint8_t samples;int16_t[32] x;"
    )
    parts = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0), message("F", fields)]
    parts.append(message("A", struct.pack("<BH", 0, 3) + b"sensor_gyro_fifo"))
    for k in range(0, RATE.size, 8):
        row = [*COUNTS[k : k + 8].tolist(), *[0] * 24]
        content = struct.pack("<HQQIffB32h", 3, k * 1000 + 9000, k * 1000, 5, 1000.0, np.deg2rad(0.002), 8, *row)
        parts.append(message("D", content))
    path.write_bytes(b"".join(parts))


def miniseed(path):
    obspy = pytest.importorskip("obspy")
    stats = {"station": "RLAS", "channel": "HJZ", "sampling_rate": FS, "starttime": obspy.UTCDateTime(2024, 1, 1)}
    obspy.Stream([obspy.Trace(COUNTS.astype(np.int32), header=stats)]).write(str(path), format="MSEED")


def uff(path):
    """Return data set 58 as modal analysers write it, in letters."""
    pytest.importorskip("pyuff")
    unit = "         0    0    0    0 NONE                 {:<20}"
    rows = [
        "    -1", "    58", *["NONE"] * 5,
        "    1         0    0         0 gyro               1   1 NONE               0   0",
        f"         4{RATE.size:10d}         1{0.0:13.5e}{1.0 / FS:13.5e}{0.0:13.5e}",
        unit.format("s"), unit.format("deg/s"), unit.format("NONE"), unit.format("NONE"),
        *("".join(f"{value:20.12e}" for value in RATE[k : k + 4]) for k in range(0, RATE.size, 4)),
        "    -1",
    ]  # fmt: skip
    path.write_text("\n".join(rows) + "\n")


def ide(path):
    """Return a recording as enDAQ's loggers write it, element by element of the library's own schema."""
    idelib, ebmlite = pytest.importorskip("idelib"), pytest.importorskip("ebmlite")
    from importlib.resources import files

    schema = ebmlite.loadSchema(str(files(idelib) / "schemata" / "mide_ide.xml"))
    parts = [
        {
            "SubChannelID": k,
            "SubChannelName": name,
            "SubChannelLabel": "Rotation",
            "SubChannelUnits": "deg/s",
            "SubChannelCalibrationIDRef": 1,
        }
        for k, name in enumerate("XY")
    ]
    channel = {
        "ChannelID": 47,
        "ChannelName": "Gyroscope",
        "TimeCodeScale": "1.0/1000000",
        "ChannelFormat": "<hh",
        "TimeCodeModulus": 1 << 40,
        "SubChannel": parts,
    }
    recorder = {"RecorderTypeUID": 16, "RecorderSerial": 1, "ProductName": "LOG-0002"}
    head = {
        "EBMLVersion": 1,
        "EBMLReadVersion": 1,
        "EBMLMaxIDLength": 4,
        "EBMLMaxSizeLength": 8,
        "DocType": "mide",
        "DocTypeVersion": 2,
        "DocTypeReadVersion": 2,
    }
    scale = {"CalID": 1, "CalReferenceValue": 0.0, "PolynomialCoef": [0.002, 0.0]}
    elements = [
        ("EBML", head),
        ("RecordingProperties", {"RecorderInfo": recorder, "ChannelList": {"Channel": [channel]}}),
        ("CalibrationList", {"UnivariatePolynomial": [scale]}),
    ]
    rows = np.stack([COUNTS, -COUNTS], axis=1).astype("<i2")
    for k in range(0, RATE.size, 500):
        ends = {"StartTimeCodeAbs": int(TIME_US[k]), "EndTimeCodeAbs": int(TIME_US[k + 499])}
        data = {"ChannelIDRef": 47, **ends, "ChannelDataPayload": rows[k : k + 500].tobytes()}
        elements.append(("ChannelDataBlock", data))
    path.write_bytes(b"".join(schema[name].encode(content) for name, content in elements))


COUNTED = 0.002 * COUNTS
# Writer, what is said beside the file, the rate in deg/s that is in it, and how exact it is.
FORMATS = [
    (mat5, {"unit": "deg/s", "column": ["rate"]}, RATE, 1e-15),
    (mat5_struct, {"unit": "deg/s", "column": ["imu/gyro[0]"]}, RATE, 1e-15),
    (mat73, {"unit": "deg/s", "column": ["gyro[0]"]}, RATE, 1e-15),
    (hdf5, {}, RATE, 1e-7),
    (hdf5_records, {"unit": "deg/s", "column": ["log/w"], "time": "log/t", "time_unit": "us"}, RATE, 1e-15),
    (netcdf4, {}, COUNTED, 1e-15),
    (netcdf3, {}, RATE, 1e-15),
    (npy, {"unit": "deg/s", "rate": "1 kHz"}, RATE, 1e-15),
    (npz, {"unit": "rad/s", "column": ["w"]}, RATE, 1e-15),
    (parquet, {}, RATE, 1e-15),
    (feather, {}, RATE, 1e-15),
    (mdf, {"column": ["w"]}, RATE, 1e-15),
    (tdms, {}, RATE, 1e-15),
    (ros2, {"column": ["angular_velocity.x"]}, RATE, 1e-15),
    (ros2_sqlite, {"column": ["angular_velocity.x"]}, RATE, 1e-15),
    (mcap_json, {}, RATE, 1e-15),
    (ulog, {}, RATE, 1e-7),
    (ulog_fifo, {}, COUNTED, 1e-6),
    (miniseed, {"scale": "0.002 deg/s", "column": ["counts"]}, COUNTED, 1e-15),
    (uff, {}, RATE, 1e-7),
    (ide, {"column": ["Gyroscope/X"]}, COUNTED, 1e-15),
]


@pytest.mark.oracle
@pytest.mark.parametrize(
    ("write", "options", "expected", "accuracy"), FORMATS, ids=lambda v: getattr(v, "__name__", "")
)
def test_every_format_gives_its_samples_whatever_its_name(tmp_path, write, options, expected, accuracy):
    path = tmp_path / "log.csv"
    write(path)
    (record,) = read(path, Selection(**options))
    np.testing.assert_allclose(record.rate, np.deg2rad(expected), rtol=4.0 * accuracy, atol=2.0 * accuracy)
    assert record.sample_rate_hz == pytest.approx(FS, rel=1e-6)
    found = analyse(record).fit.angle_random_walk
    assert found.lower < N < found.upper


@pytest.mark.parametrize("write", [row[0] for row in FORMATS], ids=lambda v: v.__name__)
@pytest.mark.parametrize("keep", [0.5, 0.03])
def test_a_file_that_was_cut_is_an_error_or_what_is_left_of_it(tmp_path, write, keep):
    """Never a traceback: the format is named, or as much as there is of it is read."""
    whole, path = tmp_path / "whole", tmp_path / "log.bin"
    write(whole)
    content = whole.read_bytes()
    path.write_bytes(content[: int(keep * len(content))])
    log = None
    with contextlib.suppress(ScenarioError):
        log = read_log(path)
    if log is not None:
        assert all(channel.values.size <= RATE.size for channel in log.channels.values())


def test_run_nc_is_read_by_group(tmp_path):
    import h5py

    path = tmp_path / "run.nc"
    with h5py.File(path, "w") as file:
        for group, n_time in (("sensors/a", 400), ("sensors/b", 40)):
            file[f"{group}/time"], file[f"{group}/rate"] = np.arange(n_time) * (1.0 / n_time), np.ones(n_time)
            file[f"{group}/time"].attrs["units"], file[f"{group}/rate"].attrs["units"] = "s", "rad/s"
    channels = read_log(path).channels
    assert {name: round(c.rate_hz) for name, c in channels.items()} == {"sensors/a/rate": 400, "sensors/b/rate": 40}


def test_a_library_that_is_missing_is_named_with_the_line_that_installs_it(tmp_path, monkeypatch):
    path = tmp_path / "log.mf4"
    path.write_bytes(b"MDF     4.10    " + bytes(600))
    monkeypatch.setitem(sys.modules, "asammdf", None)
    with pytest.raises(ScenarioError, match=r"is MDF4, for which asammdf is needed: pip install '.*\[logs\]'"):
        read_log(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"\x1f\x8b" + bytes(100), "gunzip it first"),
        (b"PK\x03\x04" + bytes(100), "cannot be read"),
        (b"\xd0\xcf\x11\xe0" + bytes(100), "save the sheet as CSV"),
        (b"", "got an empty file"),
        (b"   \n\n", "got nothing"),
        (b"%PDF-1.7", "a PDF document"),
        (b"\x89HDF\r\n\x1a\n" + bytes(50), "HDF5"),
        (b"PAR1" + bytes(100) + b"PAR1", "Parquet"),
    ],
)
def test_what_is_no_recording_is_named(tmp_path, content, message):
    path = tmp_path / "log.csv"
    path.write_bytes(content)
    with pytest.raises(ScenarioError, match=message):
        read_log(path)
