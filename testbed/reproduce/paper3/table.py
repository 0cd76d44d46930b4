"""The rows of paper 3's Table 2 on our data: medians over the seeds and how far they scatter, as CSV and as lines."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.drift.table_2 import TABLE_2

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    # What the audits of each method say, seed by seed, by its name and what it is trained on.
    Found = Mapping[tuple[str, str], Sequence[Mapping[str, Any]]]

COLUMNS = (
    "quantization_urad",
    "bias_instability_deg_h",
    "angle_random_walk_deg_sqrt_h",
    "block_std_100s_deg_h",
    "allan_deviation_1h_deg_h",
    "drift_reduction",
    "oracle_ratio_1h",
    "block_std_over_oracle",
    "bandwidth_hz",
    "least_gain_in_drift_band",
    "step_gain",
    "seconds",
)
PAPER_COLUMNS = (
    "paper_quantization",
    "paper_bias_instability_deg_h",
    "paper_angle_random_walk_deg_sqrt_h",
    "paper_seconds",
)
# What is printed of them, and how.
_HEADS = {
    "bias_instability_deg_h": "B",
    "angle_random_walk_deg_sqrt_h": "N",
    "drift_reduction": "drift /",
    "block_std_over_oracle": "100 s/oracle",
    "oracle_ratio_1h": "1 h/oracle",
    "least_gain_in_drift_band": "slow gain",
    "step_gain": "step gain",
}


def medians_csv(found: Found) -> str:
    """Return table_2.csv: the median of each figure beside the paper's, and the paper's methods that are not ours.

    Parameters
    ----------
    found : mapping
        Summaries of the audits of each method by name and what it is trained on, seed by seed.
    """
    lines = [",".join(("method", "trained_on", "leaks", "refused", *COLUMNS, *PAPER_COLUMNS))]
    for (name, trained_on), runs in found.items():
        figures = map(_text, (*_medians(runs), *TABLE_2.get(name, (None,) * 4)))
        lines.append(",".join([name, trained_on, *map(str, _verdicts(runs)), *figures]))
    ours = {name for name, _ in found}
    blank = ["" for _ in ("trained_on", "leaks", "refused", *COLUMNS)]
    lines += [",".join([name, *blank, *map(_text, values)]) for name, values in TABLE_2.items() if name not in ours]
    return "\n".join(lines) + "\n"


def seeds_csv(found: Found) -> str:
    """Return table_2_seeds.csv: the figures of every seed by themselves; arguments as `medians_csv`."""
    lines = [",".join(("method", "trained_on", "seed", "leaks", "refused", *COLUMNS))]
    for (name, trained_on), runs in found.items():
        for seed, run in enumerate(runs, start=1):
            figures = map(_text, _figures(run))
            lines.append(",".join([name, trained_on, str(seed), *map(str, _verdicts([run])), *figures]))
    return "\n".join(lines) + "\n"


def shown_rows(found: Found) -> list[dict[str, Any]]:
    """Return the rows of the page; the paper's methods that are not ours last; arguments as `medians_csv`."""
    shown: list[dict[str, Any]] = []
    for (name, trained_on), runs in found.items():
        leaks, refused = _verdicts(runs)
        known = {"method": name, "trained_on": trained_on, "leaks": leaks, "refused": refused}
        shown.append({**known, **dict(zip(COLUMNS, _medians(runs), strict=True))})
    ours = {row["method"] for row in shown}
    blank = {"trained_on": "", "leaks": None, "refused": None, **dict.fromkeys(COLUMNS)}
    shown += [{"method": name, **blank} for name in TABLE_2 if name not in ours]
    return [{**row, **_paper_of(row["method"])} for row in shown]


def printed(found: Found, seeds: int) -> Iterator[str]:
    """Yield the medians line by line, then between what least and largest value the seeds are.

    Parameters
    ----------
    found : mapping
        As for `medians_csv`.
    seeds : int
        How many.
    """
    yield (
        f"Table 2 on our data, median over {seeds} seed(s); B in deg/h, N in deg/sqrt(h), none where the noise "
        "model does not describe the curve"
    )
    yield _line(("method", "trained on"), ("paper B", "paper N", *_HEADS.values(), "leaks", "refused"), 13)
    for key, runs in found.items():
        at, paper = dict(zip(COLUMNS, _medians(runs), strict=True)), _paper_of(key[0])
        figures = (paper["paper_b"], paper["paper_n"], *(at[name] for name in _HEADS))
        yield _line(key, (*map(_short, figures), *(f"{n}/{seeds}" for n in _verdicts(runs))), 13)
    if seeds > 1:
        yield ""
        certain = 1.0 - 2.0 * 0.5**seeds
        yield f"least and largest of the {seeds} seeds, which the median of all seeds lies between with {certain:.0%}"
        yield _line(("method", "trained on"), _HEADS.values(), 20)
        for key, runs in found.items():
            spans = dict(zip(COLUMNS, _spans(runs), strict=True))
            yield _line(key, (spans[name] for name in _HEADS), 20)


def _line(names: tuple[str, str], cells: Iterable[str], width: int) -> str:
    return f"{names[0]:31s}{names[1]:16s}" + "".join(f"{cell:>{width}s}" for cell in cells)


def _figures(run: Mapping[str, Any]) -> list[float | None]:
    coefficients = run["after"]["coefficients"] or {}
    values = [coefficients.get(letter, {}).get("value") for letter in ("Q", "B", "N")]
    keys = ("block_std_100s_deg_h", "allan_deviation_1h_deg_h")
    return [*values, *(run["after"][key] for key in keys), *(run[key] for key in COLUMNS[5:])]


def _known(runs: Sequence[Mapping[str, Any]]) -> list[list[float]]:
    """Return of each figure those of the seeds that have it; none if most of them have none."""
    columns = zip(*map(_figures, runs), strict=True)
    known = [[value for value in column if value is not None] for column in columns]
    return [values if 2 * len(values) > len(runs) else [] for values in known]


def _medians(runs: Sequence[Mapping[str, Any]]) -> list[float | None]:
    return [float(np.median(values)) if values else None for values in _known(runs)]


def _spans(runs: Sequence[Mapping[str, Any]]) -> list[str]:
    return [f"{min(values):.3g} to {max(values):.3g}" if values else "-" for values in _known(runs)]


def _verdicts(runs: Sequence[Mapping[str, Any]]) -> tuple[int, int]:
    """Return how many audits found a leak, and how many refused it for whatever reason."""
    return sum(bool(run["leaks"]) for run in runs), sum(not run["passed"] for run in runs)


def _paper_of(name: str) -> dict[str, float | None]:
    _, b, n, _ = TABLE_2.get(name, (None,) * 4)
    return {"paper_b": b, "paper_n": n}


def _text(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"


def _short(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"
