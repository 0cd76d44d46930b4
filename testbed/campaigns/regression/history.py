"""What the standard campaign gave, version after version: one Parquet file in the package, one row per seed."""

from __future__ import annotations

import io
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from testbed._version import __version__
from testbed.campaigns.regression.standard import AXES
from testbed.campaigns.rows import OK
from testbed.errors import Problem, ScenarioError
from testbed.runs.atomic import write_bytes

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    import pyarrow as pa

    Row = Mapping[str, Any]

HISTORY = Path(str(resources.files("testbed.campaigns.regression") / "history.parquet"))
# Of each row of a campaign, what is stored; gain and phase are of the first line.
NUMBERS = (
    *("rmse_deg_s", "mean_std_deg_s", "nees", "optimum_rmse_deg_s", "floor_rmse_deg_s", "gain", "phase_deg"),
    *("residual_rms_urad", "rpe_urad.0.1"),
)
_TEXTS = ("campaign", "version", "reason", "kind", "source", *AXES)


def essence(rows: Iterable[Row]) -> list[dict[str, Any]]:
    """Return what is stored of the rows of a campaign, its failures left out.

    Parameters
    ----------
    rows : iterable of mapping
        As `testbed.open_sweep` has them.
    """
    found = []
    for row in rows:
        if row["status"] == OK:
            first = row["lines"][0] if row["lines"] else {}
            numbers = {name: row[name] if name in row else first.get(name) for name in NUMBERS}
            found.append({name: row[name] for name in ("seed", "kind", "source", *AXES)} | numbers)
    return found


def read_history(path: Path = HISTORY) -> list[dict[str, Any]]:
    """Return all rows that are stored, the oldest entry first; none if there is no file.

    Parameters
    ----------
    path : Path, optional
        Another file.
    """
    import pyarrow.parquet as pq

    return pq.read_table(path).to_pylist() if path.exists() else []


def latest(history: Sequence[Row], campaign: str) -> list[Row]:
    """Return the rows of the last entry of a campaign.

    Parameters
    ----------
    history : sequence of mapping
        As stored.
    campaign : str
        Which.
    """
    own = [row for row in history if row["campaign"] == campaign]
    last = max((row["entry"] for row in own), default=0)
    return [row for row in own if row["entry"] == last]


def check_reason(reason: str) -> None:
    """Raise ScenarioError if there is no reason why a baseline is another."""
    if not reason.strip():
        raise ScenarioError([Problem("expected a reason: what changed the numbers, in a sentence", "--update")])


def append(rows: Iterable[Row], costs: Mapping[str, float], campaign: str, reason: str, path: Path = HISTORY) -> None:
    """Store the rows of a campaign as its baseline from now on.

    Parameters
    ----------
    rows : iterable of mapping
        As `essence` gives them.
    costs : mapping of str to float
        Time of a filter over that of `kalman` [-].
    campaign : str
        Which.
    reason : str
        Why it is another.
    path : Path, optional
        Another file.

    Raises
    ------
    ScenarioError
        If the reason is empty or the file cannot be written.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    check_reason(reason)
    history = read_history(path)
    common = {
        "campaign": campaign,
        "entry": 1 + max((row["entry"] for row in history), default=0),
        "version": __version__,
        "reason": reason.strip(),
    }
    new = [{**common, **row, "cost": costs.get(row["source"])} for row in rows]
    content = io.BytesIO()
    pq.write_table(pa.Table.from_pylist([*history, *new], schema=_schema()), content, compression="zstd")
    try:
        write_bytes(path, content.getvalue())
    except OSError as error:
        raise ScenarioError([Problem(f"cannot be written: {error.strerror}", file=str(path))]) from error


def _schema() -> pa.Schema:
    import pyarrow as pa

    texts = [(name, pa.dictionary(pa.int32(), pa.string())) for name in _TEXTS]
    # Single precision is 1e-6 dB, and half of the file.
    numbers = [(name, pa.float32()) for name in (*NUMBERS, "cost")]
    return pa.schema([("entry", pa.int32()), ("seed", pa.int32()), *texts, *numbers])
