"""Folders that a command names itself: gone on with by the code that began them, played anew by any other."""

from __future__ import annotations

import hashlib
import json
import shutil
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from testbed.campaigns.store import STUDY, read_cases
from testbed.chain.versions import versions
from testbed.errors import Problem, ScenarioError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from testbed.campaigns.study import Study

_OURS = {"cases.parquet", STUDY, "sweep.html", "leaderboard.html", ".lock"}


def code_sha256(plugins: Sequence[str]) -> str:
    """Return the hash of this package, of what it depends on, and of the files of plug-ins.

    Parameters
    ----------
    plugins : sequence of str
        Modules; those that are no path count by their name alone.
    """
    root = Path(str(resources.files("testbed")))
    content = hashlib.sha256(json.dumps(versions(), sort_keys=True).encode())
    for path in (*sorted(root.rglob("*.py")), *sorted(root.rglob("*.yaml")), *map(Path, plugins)):
        content.update(path.name.encode())
        if path.is_file():
            content.update(path.read_bytes())
    return content.hexdigest()


def make_way(folder: Path, study: Study, plugins: Sequence[str] = ()) -> None:
    """Remove what other code has played of a campaign; what the same code has is gone on with.

    A campaign of plug-ins that came to its end is removed too, since a plug-in may import what is not known here.

    Parameters
    ----------
    folder : Path
        Of the campaign; a sweep of another name is left as it is, and refused later.
    study : Study
        What is to be played, with its code.
    plugins : sequence of str, optional
        Of its filters.

    Raises
    ------
    ScenarioError
        If the folder has to go and holds files of somebody else.
    """
    try:
        known = json.loads((folder / STUDY).read_text("utf-8"))
    except (OSError, ValueError):
        return
    if known.get("name") != study.name:
        return
    if known.get("code") != study.code or (plugins and _finished(folder, study)):
        _remove(folder)


def _finished(folder: Path, study: Study) -> bool:
    rows = read_cases(folder, ["case", "seed"])
    done = set(zip(rows["case"].to_pylist(), rows["seed"].to_pylist(), strict=True))
    return len(done) >= len(study.cases) * len(study.seeds)


def _remove(folder: Path) -> None:
    others = sorted(entry.name for entry in folder.iterdir() if entry.name not in _OURS)
    if others:
        msg = f"holds the campaign of other code, which would be replaced, and {', '.join(others)}: move that away"
        raise ScenarioError([Problem(msg, file=str(folder))])
    shutil.rmtree(folder)
