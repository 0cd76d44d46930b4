"""One record of known noise, written as loggers of many kinds write it."""

# ruff: noqa: E501 - a table reads best with a kind a line
from __future__ import annotations

import numpy as np

from testbed.sensors.noise import GyroNoise

# deg/sqrt(h), and in SI.
N_SHEET = 0.3
N = np.deg2rad(N_SHEET) / 60.0
FS = 1000.0
N_TIME = 4000
RATE = np.round(np.degrees(GyroNoise(angle_random_walk=N).sample(N_TIME, FS, 5)), 6)
TIME_US = np.arange(N_TIME) * 1000
EPOCH_NS = 1_403_715_273_262_142_976


def lines(*columns, head="", separator=",", end="\n"):
    """Return a text of columns that are lists of text."""
    return head + "".join(separator.join(row) + end for row in zip(*columns, strict=True))


def digits(values, form="{:.6f}"):
    return [form.format(value) for value in values]


def comma(values):
    return [text.replace(".", ",") for text in values]


SECONDS = digits(TIME_US / 1e6, "{:.3f}")
DEG = digits(RATE)
STAMPS = [str(EPOCH_NS + 1000 * int(t)) for t in TIME_US]
ISO = [str(np.datetime64("2024-05-01T12:00:00") + np.timedelta64(int(t), "us")) for t in TIME_US]
COUNTS = np.rint(RATE / 0.002).astype(int)
ANGLE = np.cumsum(np.concatenate([[0.0], RATE / FS * 3600.0]))

# Name: text, encoding, options beside the file.
TEXTS = {
    "plain": (lines(SECONDS, DEG, head="t,rate [deg/s]\n"), "utf-8", {}),
    "no header": (lines(SECONDS, DEG), "utf-8", {"column": ["2"], "time": "1", "unit": "deg/s"}),
    "one column": (lines(DEG), "utf-8", {"rate": "1 kHz", "unit": "deg/s"}),
    "header behind a mark, epoch ns": (lines(STAMPS, DEG, head="#timestamp [ns],w_x [deg s^-1]\n"), "utf-8", {}),
    "epoch s": (lines(digits((EPOCH_NS / 1e3 + TIME_US) / 1e6, "{:.6f}"), DEG, head="stamp,w (deg/s)\n"), "utf-8", {}),
    "semicolons": (lines(SECONDS, DEG, head="time;rate(deg/s)\n", separator=";"), "utf-8", {}),
    "decimal comma": (lines(comma(SECONDS), comma(DEG), head="Zeit;Rate [deg/s]\n", separator=";"), "utf-8", {}),
    "decimal comma, tabs": (lines(comma(SECONDS), comma(DEG), head="t\tw\n", separator="\t"), "utf-8", {"unit": "dps"}),
    "decimal comma alone": (lines(comma(DEG)), "utf-8", {"rate": "1000", "unit": "deg/s", "text": {"decimal": ","}}),
    "blanks": (lines([f"  {t}" for t in SECONDS], [f"   {d}  " for d in DEG], separator=" "), "utf-8",
               {"column": ["2"], "time": "1", "unit": "deg/s"}),
    "blanks after commas": (lines(list(map(str, TIME_US)), DEG, head="time (us), gyroADC[0] (deg/s)\n", separator=", "),
                            "utf-8", {}),
    "bars": (lines(SECONDS, DEG, head="time [s]|gyro [deg/s]\n", separator="|"), "utf-8", {}),
    "units in a line": (lines(SECONDS, DEG, head="time,rate\n(s),(deg/s)\n"), "utf-8", {}),
    "cp1252": (lines(comma(SECONDS), comma(DEG), head="Zeit;Rate\ns;°/s\n", separator=";", end="\r\n"), "cp1252", {}),
    "byte order mark": (lines(SECONDS, DEG, head="t,rate [deg/s]\n"), "utf-8-sig", {}),
    "utf-16": (lines(SECONDS, DEG, head="t,rate [deg/s]\n"), "utf-16", {}),
    "carriage returns alone": (lines(SECONDS, DEG, head="t,rate [deg/s]\r", end="\r"), "utf-8", {}),
    "iso time": (lines([f"{t}Z" for t in ISO], DEG, head="Timestamp,Gyro [deg/s]\n"), "utf-8", {}),
    "iso time with a blank": (lines([t.replace("T", " ") for t in ISO], DEG, head="when,w_dps\n"), "utf-8", {"time": "when"}),
    "time of day": (lines([t[11:] for t in ISO], DEG, head="time,w [deg/s]\n"), "utf-8", {}),
    "trailing commas": (lines(SECONDS, DEG, [""] * N_TIME, head="time,rate [deg/s],\n"), "utf-8", {}),
    "trailing commas, none in the header": (lines(SECONDS, DEG, [""] * N_TIME, head="time,rate [deg/s]\n"), "utf-8", {}),
    "quotes": (lines([f'"{t}"' for t in SECONDS], [f'"{d}"' for d in DEG], head='"t","rate [deg/s]"\n'), "utf-8", {}),
    "text column": (lines(SECONDS, ["warm"] * N_TIME, DEG, head="t,state,w [deg/s]\n"), "utf-8", {}),
    "percent marks": (lines(SECONDS, DEG, head="% made by x\n% t, rate [deg/s]\n"), "utf-8", {}),
    "slashes between rows": (
        lines(SECONDS, DEG, head="// t,w\nt,rate [deg/s]\n").replace("\n1.000,", "\n// a remark, by hand\n1.000,"), "utf-8", {}),
    "preamble": (
        lines([str(int(t) // 1000) for t in TIME_US], list(map(str, COUNTS)), list(map(str, COUNTS // 2)),
              head=f"CAMERA LOG\nversion,1.3\ntscale,0.001\ngscale,{np.deg2rad(0.002):.9g}\nt,gx,gy\n"),
        "utf-8", {"column": ["gx"]}),
    "lines to skip": (
        lines(SECONDS, DEG, head="1,2\n3,4\nt,rate [deg/s]\n"), "utf-8", {"text": {"skip": 2}}),
    "counts": (lines(list(map(str, TIME_US)), list(map(str, COUNTS)), head="us,raw\n"), "utf-8", {"scale": "0.002 deg/s"}),
    "increments": (lines(digits(RATE / FS * 3600.0, "{:.9g}"), head="dtheta_arcsec\n"), "utf-8",
                   {"rate": "1000", "kind": "increment"}),
    "angle": (lines(digits(ANGLE, "{:.12g}"), head="angle [arcsec]\n"), "utf-8", {"rate": "1000", "kind": "angle"}),
    "unit of the time alone": (lines([str(10 * int(t) // 1000) for t in TIME_US], DEG, head="clock,w [deg/s]\n"), "utf-8", {"time_unit": "0.1 ms"}),
    "day before month, comma in seconds": (
        lines([f"01.05.2024 12:00:{int(t) // 10**6:02d},{int(t) // 1000 % 1000:03d}" for t in TIME_US], comma(DEG), head="Zeit;Rate [°/s]\n", separator=";"), "utf-8", {}),
    "number of the row": (lines(list(map(str, range(N_TIME))), SECONDS, DEG, head=",time,rate\n"), "utf-8", {"unit": "deg/s"}),
    "a word that means none": (lines([*SECONDS, "4.000"], [*DEG, "OVF"], head="t,w [deg/s]\n"), "utf-8", {"text": {"missing": "OVF"}}),
    "several tables of words": (
        lines(["IMU"] * N_TIME, list(map(str, TIME_US)), DEG, separator=", "), "utf-8", {"column": ["3"], "time": "2", "time_unit": "us", "unit": "deg/s"}),
    "rate stated in the head": (lines(DEG, head="# fs = 1 kHz\nrate [deg/s]\n"), "utf-8", {}),
    "counter that wraps": (
        lines([str((int(t) + (1 << 32) - 1_500_000) % (1 << 32)) for t in TIME_US], DEG, head="us,w [deg/s]\n"), "utf-8", {}),
}  # fmt: skip
