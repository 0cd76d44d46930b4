"""Which format a file has, by its first bytes, and the table that reads it."""

from __future__ import annotations

import re
import struct
from importlib import import_module
from typing import TYPE_CHECKING, cast

from testbed.logs.fifo import FifoTable, has_rows_of_samples
from testbed.logs.options import refusal
from testbed.logs.readers.text import TextTable

if TYPE_CHECKING:
    from pathlib import Path

    from testbed.logs.selection import TextOptions
    from testbed.logs.table import Table

_HDF5 = b"\x89HDF\r\n\x1a\n"
# First bytes, what the format is called, and what is to be done with those that are no recordings.
SIGNATURES = (
    (b"MATLAB 5.0 MAT-file", "MATLAB 5"),
    (b"\x93NUMPY", "npy"),
    (b"PAR1", "Parquet"),
    (b"ARROW1", "Arrow"),
    (b"CDF\x01", "NetCDF 3"),
    (b"CDF\x02", "NetCDF 3"),
    (b"MDF     ", "MDF4"),
    (b"TDSm", "TDMS"),
    (b"\x89MCAP0\r\n", "MCAP"),
    (b"#ROSBAG V2.0", "ROS bag"),
    (b"ULog\x01\x12\x35", "ULog"),
    (b"\x1a\x45\xdf\xa3", "IDE"),
    (b"SQLite format 3\0", "ROS 2 bag (db3)"),
)
_STRANGERS = (
    (b"\x1f\x8b", "a gzip archive: gunzip it first"),
    (b"BZh", "a bzip2 archive: bunzip2 it first"),
    (b"\xfd7zXZ", "an xz archive: unxz it first"),
    (b"\x28\xb5\x2f\xfd", "a zstd archive: unzstd it first"),
    (b"7z\xbc\xaf", "a 7z archive: unpack it first"),
    (b"\xd0\xcf\x11\xe0", "an Excel workbook: save the sheet as CSV"),
    (b"%PDF", "a PDF document"),
    (b"\x89PNG", "a picture"),
    (b"RIFF", "a RIFF file (sound): write its samples to a text or npy file"),
)
_MAT4, _LONGEST_NAME = struct.Struct("<5i"), 64
_JSON = re.compile(rb'\s*[\[{]\s*["{\[]')
_JSON_LINE = re.compile(rb"\s*[\[{][^\[{\]}\n]*[\]}],?\r?\n")
_MINISEED = re.compile(rb"(\d{6}[DRQM][ \0])|(MS\x03)")
_UFF = re.compile(rb"\s{4}-1\s*\r?\n\s*\d+")
# Formats that need a library of `testbed[logs]`: module below `readers`, and the library.
EXTRAS = {
    "MDF4": ("mdf", "asammdf"),
    "TDMS": ("tdms", "nptdms"),
    "MCAP": ("ros", "rosbags"),
    "ROS bag": ("ros", "rosbags"),
    "ROS 2 bag (db3)": ("ros", "rosbags"),
    "ULog": ("ulog", "pyulog"),
    "MiniSEED": ("miniseed", "obspy"),
    "IDE": ("ide", "idelib"),
    "UFF": ("uff", "pyuff"),
}


def open_table(path: Path, options: TextOptions | None = None) -> Table:
    """Return the table that a file holds, whatever its name.

    Parameters
    ----------
    path : Path
        The file.
    options : TextOptions, optional
        How it is written if it is a text.

    Returns
    -------
    Table
        Its columns; where rows hold several samples, sample by sample.

    Raises
    ------
    ScenarioError
        If it cannot be read, its format is not known, or a library for it is not installed.
    """
    if not path.is_file():
        raise refusal(path, "expected a recording (a file), got none")
    if not path.stat().st_size:  # or one of the kernel's, which may keep a reader waiting
        raise refusal(path, "expected a recording, got an empty file")
    try:
        with path.open("rb") as stream:
            head = stream.read(512)
    except OSError as error:
        raise refusal(path, f"cannot be read: {error.strerror or error}") from error
    table = _open(path, format_of(path, head), options)
    if not table.columns:
        noted = "; ".join(table.notes)
        raise refusal(path, f"expected a column of numbers ({table.format}), got none{f': {noted}' if noted else ''}")
    return FifoTable(table) if has_rows_of_samples(table) else table


def format_of(path: Path, head: bytes) -> str:
    """Return the name of a file's format by its first bytes; ``text`` if no other.

    Raises
    ------
    ScenarioError
        If it is a format that holds no recording, with what is to be done.
    """
    for mark, what in _STRANGERS:
        if head.startswith(mark):
            raise refusal(path, f"expected a recording, got {what}")
    if head.startswith(b"PK\x03\x04"):
        return _zipped(path)
    if head.startswith(_HDF5) or head[128:512].find(_HDF5) >= 0 or _is_mat73(path, head):
        return "MATLAB 7.3" if head.startswith(b"MATLAB 7.3") else "HDF5"
    for mark, name in SIGNATURES:
        if head.startswith(mark):
            return name
    if _is_mat4(head):
        return "MATLAB 4"
    if _JSON.match(head) and not _JSON_LINE.match(head):
        raise refusal(
            path, 'expected a recording, got JSON in one piece: write one sample a line, such as {"t": 0, "w": 1}'
        )
    return "MiniSEED" if _MINISEED.match(head) else "UFF" if _UFF.match(head) else "text"


def _is_mat4(head: bytes) -> bool:
    """Return whether a file begins as a matrix of MATLAB 4 does, which has no mark: five numbers and a name."""
    if len(head) < _MAT4.size:
        return False
    kind, rows, columns, imaginary, length = _MAT4.unpack_from(head)
    name = head[_MAT4.size : _MAT4.size + length] if 1 < length <= _LONGEST_NAME else b""
    known = kind in range(0, 60, 10) and rows > 0 and columns > 0 and imaginary in {0, 1}
    return known and name.endswith(b"\0") and name[:-1].isalnum()


def _is_mat73(path: Path, head: bytes) -> bool:
    """Return whether the HDF5 part begins after the 512 bytes that MATLAB puts before."""
    if not head.startswith(b"MATLAB 7.3"):
        return False
    with path.open("rb") as stream:
        stream.seek(512)
        return stream.read(8) == _HDF5


def _zipped(path: Path) -> str:
    import zipfile

    try:
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
    except (zipfile.BadZipFile, OSError, ValueError) as error:
        raise refusal(path, f"cannot be read (zip): {error}; is the file cut?") from error
    if any(name.endswith(".npy") for name in names):
        return "npz"
    if "[Content_Types].xml" in names:
        raise refusal(path, "expected a recording, got an Excel workbook: save the sheet as CSV")
    raise refusal(path, f"expected a recording, got a zip archive with {', '.join(names[:5])}: unzip it first")


def _open(path: Path, name: str, options: TextOptions | None) -> Table:
    if name in EXTRAS:
        return _open_extra(path, name)
    if name == "text":
        return TextTable(path, options)
    if name in {"HDF5", "MATLAB 7.3"}:
        from testbed.logs.readers.hdf5 import open_hdf5

        return open_hdf5(path, name)
    if name in {"Parquet", "Arrow"}:
        from testbed.logs.readers.arrow import ArrowTable

        return ArrowTable(path, name)
    if name in {"MATLAB 4", "MATLAB 5"}:
        from testbed.logs.readers.matlab import open_mat

        return open_mat(path, name)
    from testbed.logs.readers import numpy_files

    return {"npy": numpy_files.open_npy, "npz": numpy_files.open_npz, "NetCDF 3": numpy_files.open_netcdf3}[name](path)


def _open_extra(path: Path, name: str) -> Table:
    module, library = EXTRAS[name]
    try:
        import_module(library)
    except ImportError as error:
        message = f"is {name}, for which {library} is needed: pip install 'angular-rate-testbed[logs]'"
        raise refusal(path, message) from error
    opened = getattr(import_module(f"testbed.logs.readers.{module}"), f"open_{module}")
    return cast("Table", opened(path, name))
