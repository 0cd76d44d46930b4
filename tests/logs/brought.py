"""Twenty-four recordings such as people bring, each with a noise of its own: twelve kinds that shaped the reader, twelve
that came after it.
"""

# ruff: noqa: E501 - a table reads best with a kind a line
from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from testbed.sensors.noise import GyroNoise
from tests.logs.kinds import comma, digits, lines

EPOCH_NS = 1_714_564_800_000_000_000


@dataclass
class Noise:
    """A record at rest: N in deg/sqrt(h), its sample rate, and the record in deg/s."""

    seed: int
    sheet: float
    fs: float
    n: int = 4000
    rate: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        self.rate = np.degrees(GyroNoise(angle_random_walk=self.si).sample(self.n, self.fs, self.seed))

    @property
    def si(self) -> float:
        return np.deg2rad(self.sheet) / 60.0

    @property
    def t(self) -> np.ndarray:
        return np.arange(self.n) / self.fs

    def us(self, start: int = 0) -> list[str]:
        return [str(start + round(1e6 * x)) for x in self.t]

    def ns(self) -> list[str]:
        return [str(EPOCH_NS + round(1e9 * x)) for x in self.t]

    @property
    def deg(self) -> list[str]:
        return digits(self.rate)

    @property
    def rad(self) -> list[str]:
        return digits(np.deg2rad(self.rate), "{:.10f}")

    def counts(self, word: float) -> list[str]:
        return [str(int(c)) for c in np.rint(self.rate / word)]


@dataclass(frozen=True)
class Brought:
    """A file, what is said of it, and, where it is refused at first, why and what is said then."""

    noise: Noise
    content: bytes
    said: dict[str, Any] = field(default_factory=dict)
    refused: str = ""
    then: dict[str, Any] = field(default_factory=dict)


def text(noise, content, said=None, refused="", then=None, encoding="utf-8"):
    return Brought(noise, content.encode(encoding), said or {}, refused, then or {})


def euroc():
    x = Noise(1, 0.30, 200.0)
    return text(x, lines(x.ns(), x.rad, x.rad, head="#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1]\n"))


def rows_missing():
    x = Noise(2, 0.15, 200.0)
    rows = lines(x.ns(), x.rad, head="#timestamp [ns],w_RS_S_x [rad s^-1]\n").splitlines(keepends=True)
    return text(x, "".join(rows[:1200] + rows[1204:2500] + rows[2520:]))


def black_box():
    x = Noise(3, 60.0, 3332.0, 8000)
    kept = np.flatnonzero(np.isin(np.arange(x.n) % 14, [0, 1, 2, 3, 5, 6, 7, 9, 10, 12, 13]))
    stamps, words = x.us(1_000_000), x.counts(1.0)
    columns = ([str(k) for k in kept], [stamps[k] for k in kept], ["0"] * kept.size, [words[k] for k in kept])
    return text(x, lines(*columns, head="loopIteration, time (us), axisP[0], gyroADC[0] (deg/s)\n", separator=", "))


def camera_log():
    x = Noise(4, 0.8, 500.0)
    head = f"CAMERA LOG\nversion,1.3\ntscale,0.001\ngscale,{np.deg2rad(0.07):.9g}\nt,gx,gy\n"
    return text(
        x, lines([str(2 * k) for k in range(x.n)], x.counts(0.07), x.counts(0.07), head=head), {"column": ["gx"]}
    )


def bare_counts():
    x = Noise(5, 0.9, 500.0)
    return text(
        x,
        lines([str(2 * k) for k in range(x.n)], x.counts(0.07), head="t,gx\n"),
        {"scale": "0.07 deg/s"},
        "--time-unit",
        {"scale": "0.07 deg/s", "time_unit": "ms"},
    )


def increments():
    x = Noise(6, 8e-4, 400.0)
    said = {"rate": "400"}
    return text(
        x,
        lines(digits(x.rate / x.fs * 3600.0, "{:.8g}"), head="dtheta_arcsec\n"),
        said,
        "expected increment or angle",
        {**said, "kind": "increment"},
    )


def integrated_angle():
    x = Noise(7, 8e-4, 400.0)
    angle = np.concatenate([[0.0], np.cumsum(x.rate / x.fs * 3600.0)])
    return text(x, lines(digits(angle, "{:.12g}"), head="angle_arcsec\n"), {"rate": "400", "kind": "angle"})


def coarse_words():
    x = Noise(8, 0.06, 200.0)
    return text(
        x,
        lines([f"{0.07 * int(c):.2f}" for c in x.counts(0.07)], head="rate\n"),
        {"rate": "200", "unit": "deg/s"},
        "The record is rounding",
    )


def true_rate():
    x = Noise(9, 0.086, 48.47)
    return text(
        x,
        lines(x.us(), x.deg, head="us,rate\n"),
        {"rate": "52", "time": "us", "unit": "deg/s"},
        "contradicts the stamps",
        {"unit": "deg/s"},
    )


def quick_and_epoch():
    x = Noise(10, 0.2, 8000.0)
    return text(x, lines(x.ns(), x.deg, head="t_ns,rate [deg/s]\n"))


def of_a_bench():
    x = Noise(11, 0.5, 1000.0)
    return text(
        x,
        lines(comma(digits(x.t, "{:.4f}")), comma(x.deg), head="Zeit;Drehrate\ns;°/s\n", separator=";", end="\r\n"),
        encoding="cp1252",
    )


def queue():
    x = Noise(12, 0.6, 8000.0)
    scale, words = np.deg2rad(0.02), [int(c) for c in x.counts(0.02)]
    head = "timestamp,timestamp_sample,device_id,dt,scale,samples," + ",".join(f"x[{k}]" for k in range(8)) + "\n"
    rows = [
        f"{k * 125 + 400 + k % 37},{k * 125},7,125.0,{scale:.12g},8,{','.join(map(str, words[k : k + 8]))}\n"
        for k in range(0, x.n, 8)
    ]
    return text(x, head + "".join(rows), {"column": ["x"]}, "expected the unit", {"column": ["x"], "unit": "rad/s"})


def labels():
    x = Noise(13, 0.4, 100.0)
    return text(
        x,
        "".join(f"Rotation X: {w}\tY: {w}\tZ: {w} rad/s\n" for w in x.rad),
        {"column": ["Rotation X"], "rate": "100"},
        "expected the unit",
        {"column": ["Rotation X"], "rate": "100", "unit": "rad/s"},
    )


def sentences():
    x = Noise(14, 0.25, 100.0)
    other = "$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\n"
    rows = [
        (other if k % 100 == 7 else "") + f"$GYR,{us},{w},{w}*4F\n"
        for k, (us, w) in enumerate(zip(x.us(), x.deg, strict=True))
    ]
    said = {"column": ["3"], "time": "2", "time_unit": "us", "unit": "deg/s"}
    return text(x, "".join(rows), said, "--only WORD that all rows hold", {**said, "text": {"only": "$GYR"}})


def flight_log():
    x = Noise(15, 0.35, 400.0)
    rows = [
        (f"ATT, {us}, 0.1, 0.2, 0.3\n" if k % 10 == 0 else "") + f"IMU, {us}, {w}, {w}, {w}, 0.1, 0.2, 9.8\n"
        for k, (us, w) in enumerate(zip(x.us(), x.rad, strict=True))
    ]
    said = {"column": ["3"], "time": "2", "time_unit": "us", "unit": "rad/s"}
    return text(x, "".join(rows), said, "--only WORD that all rows hold", {**said, "text": {"only": "IMU"}})


def echoed_topic():
    x = Noise(16, 0.3, 250.0)
    head = "%time,field.header.seq,field.header.stamp,field.header.frame_id,field.angular_velocity.x\n"
    said = {"column": ["field.angular_velocity.x"]}
    return text(
        x,
        lines(x.ns(), map(str, range(x.n)), x.ns(), ["imu"] * x.n, x.rad, head=head),
        said,
        "expected the unit",
        {**said, "unit": "rad/s"},
    )


def telephone():
    x = Noise(17, 0.45, 500.0)
    return text(
        x,
        lines(x.ns(), digits(x.t, "{:.6f}"), x.rad, x.rad, head="time,seconds_elapsed,z,y\n"),
        {},
        "--column",
        {"column": ["z"], "unit": "rad/s"},
    )


def laboratory_of_a_telephone():
    x = Noise(18, 0.5, 500.0)
    return text(
        x,
        lines(
            comma(digits(x.t, "{:.9E}")),
            comma(digits(np.deg2rad(x.rate), "{:.9E}")),
            head='"Time (s)"\t"Gyroscope x (rad/s)"\n',
            separator="\t",
        ),
    )


def hexadecimal():
    x = Noise(19, 0.7, 1000.0)
    return text(
        x,
        lines(x.us(), [f"0x{int(c) & 0xFFFF:04X}" for c in x.counts(0.0175)], head="t_us,gx\n"),
        {"column": ["gx"]},
        "--scale of a count",
        {"column": ["gx"], "scale": "0.0175 deg/s"},
    )


def fortran():
    x = Noise(20, 0.02, 100.0)
    rows = zip(digits(x.t, "{:.8E}"), digits(x.rate, "{:.8E}"), strict=True)
    return text(
        x, "".join(f"   {t}  {w}\n" for t, w in rows).replace("E", "D"), {"column": ["2"], "time": "1", "unit": "deg/s"}
    )


def measurement():
    x = Noise(21, 0.1, 1000.0)
    end = "***End_of_Header***\t\t\n"
    head = f"LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\n{end}\t\nChannels\t1\t\nSamples\t4000\t\nDelta_X\t1.0E-3\t\n{end}X_Value\tw\tComment\n"
    return text(
        x,
        lines(digits(x.t, "{:.3f}"), x.deg, [""] * x.n, head=head, separator="\t"),
        {"column": ["w"], "unit": "deg/s"},
        "column of the time",
        {"column": ["w"], "unit": "deg/s", "time": "X_Value"},
    )


def two_rates():
    x = Noise(22, 0.33, 200.0)
    fast = np.arange(5 * x.n) / 1000.0
    slow = [x.deg[k // 5] if k % 5 == 2 else "" for k in range(fast.size)]
    return text(x, lines(digits(fast, "{:.3f}"), slow, ["9.81"] * fast.size, head="t,gyro [deg/s],acc [m/s^2]\n"))


def records():
    x = Noise(23, 0.28, 1000.0)
    rows = (
        json.dumps({"t": round(float(t), 6), "gx_dps": round(float(w), 6)}) + "\n"
        for t, w in zip(x.t, x.rate, strict=True)
    )
    return text(x, "".join(rows))


def torn_lines():
    x = Noise(24, 0.22, 1000.0)
    rows = lines(x.us(), x.deg, x.deg, head="us,gx [deg/s],gy [deg/s]\n").splitlines()
    rows[700], rows[1900], rows[3000] = (
        rows[700][:9],
        rows[1900].replace("-", "--").replace(",", ",\u00a4"),
        rows[3000][:4],
    )
    return text(x, "boot\n" + "\n".join(rows) + "\n", {}, "--drop-faulty", {"text": {"drop_faulty": True}})


SHAPED = (
    euroc,
    rows_missing,
    black_box,
    camera_log,
    bare_counts,
    increments,
    integrated_angle,
    coarse_words,
    true_rate,
    quick_and_epoch,
    of_a_bench,
    queue,
)
UNSEEN = (
    labels,
    sentences,
    flight_log,
    echoed_topic,
    telephone,
    laboratory_of_a_telephone,
    hexadecimal,
    fortran,
    measurement,
    two_rates,
    records,
    torn_lines,
)


def clean_log(seed, path):
    """Write a clean log of a dialect, rate, time and rounding drawn by the seed; some of them binary."""
    rng = np.random.default_rng(seed)
    fs = float(rng.choice([25.0, 48.47, 100.0, 199.2, 500.0, 1000.0, 1666.0, 3333.3, 6664.0, 8000.0]))
    n = int(rng.integers(1500, 4000))
    spread = 10.0 ** rng.uniform(-3, 0.5)
    motion = (
        rng.choice([0.0, 1.0, 30.0]) * spread * np.sin(2.0 * np.pi * 0.01 * fs * np.arange(n) / fs + rng.uniform(0, 6))
    )
    rate = rng.uniform(-3, 3) * spread + motion + spread * rng.standard_normal(n)
    word = spread * float(rng.choice([1e-3, 0.03, 0.3, 0.9]))
    rate = np.rint(rate / word) * word
    heat = np.round(25.0 + 0.3 * np.arange(n) / n, 1)
    if seed % 10 == 9:
        return clean_array(rng, path, n, fs, rate)
    separator, decimal = [(",", "."), (";", ","), (";", "."), ("\t", "."), ("\t", ","), ("|", "."), (" ", ".")][
        rng.integers(7)
    ]
    per_second = int(rng.choice([u for u in (10**3, 10**6, 10**9) if u >= 8 * fs]))
    start = int(rng.choice([0, 1_714_564_800])) * per_second
    ticks = [start + round(k * per_second / fs) for k in range(n)]
    unit = {10**3: "ms", 10**6: "us", 10**9: "ns"}[per_second]
    kind = rng.choice(["ticks", "seconds", "iso"] if separator != " " else ["ticks", "seconds"])
    if kind == "ticks":
        name, stamps = f"t [{unit}]", [str(t) for t in ticks]
    elif kind == "seconds":
        places = len(str(per_second)) - 1
        name, stamps = "t [s]", [f"{t // per_second}.{t % per_second:0{places}d}" for t in ticks]
    else:
        name, stamps = "time", [f"{np.datetime64(t * (10**9 // per_second), 'ns')}Z" for t in ticks]
    scale, written = [(1.0, "deg/s"), (1000.0, "mdps"), (np.pi / 180.0, "rad/s"), (1.0, "°/s")][rng.integers(4)]
    columns = [stamps, digits(scale * rate, "{:.9g}"), digits(heat, "{:.1f}")]
    if decimal == ",":
        columns = [comma(column) for column in columns] if kind != "iso" else [stamps, *map(comma, columns[1:])]
    names = [name, f"gyro [{written}]", "T [degC]"]
    head = separator.join(names) + "\n"
    if rng.random() < 0.3 and separator != " ":
        head = (
            separator.join(["time", "gyro", "T"])
            + "\n"
            + separator.join(["ISO" if kind == "iso" else name[3:-1], written, "degC"]).replace("ISO", "-")
            + "\n"
        )
    if rng.random() < 0.3:
        head = f"# recorded by logger {seed}\n" + head
    content = lines(*columns, head=head, separator=separator, end=str(rng.choice(["\n", "\r\n"])))
    encoding = str(rng.choice(["utf-8", "utf-8-sig", "utf-16", "cp1252"]))
    path.write_bytes(content.encode(encoding))
    return None


def clean_array(rng, path, n, fs, rate):
    """Write a clean log in a binary format of the base install."""
    import h5py
    import pyarrow as pa
    from pyarrow import parquet
    from scipy.io import savemat

    t = np.arange(n) / fs
    match rng.integers(4):
        case 0:
            parquet.write_table(
                pa.table({"stamp [ns]": EPOCH_NS + np.rint(1e9 * t).astype(np.int64), "gyro [deg/s]": rate}), path
            )
        case 1:
            with h5py.File(path, "w") as file:
                file["t_s"], file["gyro_dps"] = t, rate
        case 2:
            savemat(path, {"t_s": t, "gyro_dps": rate}, appendmat=False)
        case _:
            with path.open("wb") as stream:
                np.savez(stream, t_s=t, gyro_dps=rate)
