"""The rows on the disk: parts at their pace, and what others make of them."""

from __future__ import annotations

import time

import pytest

from testbed.campaigns.rows import schema_of
from testbed.campaigns.store import CASES, CaseStore
from testbed.campaigns.study import load_study
from tests.campaigns.test_study import written

ROWS = 100_000


@pytest.fixture
def study(tmp_path):
    return load_study(written(tmp_path, "vary: {motion.0.sine.frequency: [5 Hz, 20 Hz]}\nseeds: 3\n"))


def row(k):
    common = {"kind": "filter", "source": f"filter_{k % 5}", "motion.0.sine.frequency": 5.0, "status": "ok"}
    line = {"frequency_hz": 5.0, "gain": 1.0, "phase_deg": 0.1, "error_deg_s": 1e-3, "optimum_deg_s": 1e-4}
    numbers = {"rmse_deg_s": 1e-3 * (1 + k % 7), "mean_std_deg_s": 1e-3, "nees": 1.0, "lines": [line]}
    return {"case": k // 50, "seed": k % 50 // 5, "scenario_sha256": "0" * 64, "version": "1", **common, **numbers}


def test_parts_come_at_most_one_a_second(study, tmp_path, monkeypatch):
    """Rows that finish every 10 ms for 5 s of a clock of its own."""
    now = [100.0]
    monkeypatch.setattr("testbed.campaigns.store.time.monotonic", lambda: now[0])
    folder = tmp_path / "out"
    with CaseStore(folder, study.document(), schema_of(study)) as store:
        counts = []
        for k in range(500):
            now[0] += 0.01
            store.add([row(k)])
            counts.append(len(list((folder / CASES).glob("part-*"))))
        assert counts[0] == 1  # what is finished first is there at once
        assert counts[-1] <= 1 + 5
        # And no row waits for much longer than that second.
        assert counts[-1] >= 4
        assert all(later - sooner <= 1 for sooner, later in zip(counts, counts[100:], strict=False))


@pytest.mark.slow
def test_a_hundred_thousand_rows_open_in_under_a_second(study, tmp_path):
    """Processor time of the quickest of three, by pandas, polars and DuckDB, from the folder as it is."""
    import duckdb
    import pandas as pd
    import polars as pl

    folder = tmp_path / "out"
    with CaseStore(folder, study.document(), schema_of(study)) as store:
        for k in range(0, ROWS, 20_000):
            store.add([row(i) for i in range(k, k + 20_000)])
            store.flush()
        store.compact()
    place = folder / CASES
    readers = {
        "pandas": lambda: len(pd.read_parquet(place)),
        "polars": lambda: pl.read_parquet(place / "*.parquet").height,
        "duckdb": lambda: duckdb.sql(f"select * from '{place}/*.parquet'").df().shape[0],
    }
    for name, read in readers.items():
        spent = []
        for _ in range(3):
            begun = time.process_time()
            assert read() == ROWS
            spent.append(time.process_time() - begun)
        print(f"{name}: {min(spent):.2f} s")
        assert min(spent) < 1.0, name
