"""manifest.json: what the files of a run folder are, so that nothing else is ever replaced with them."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from testbed.runs.atomic import write_bytes, write_text
from testbed.runs.leftovers import is_partial

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

MANIFEST = "manifest.json"
# What file browsers put into every folder that is looked at.
_NOBODYS = {".DS_Store", "Thumbs.db", "desktop.ini"}


def write_manifest(folder: Path, about: Mapping[str, Any]) -> None:
    """Write the manifest of a finished folder: `about` it, and of each file its length and SHA-256.

    Parameters
    ----------
    folder : Path
        With all its files.
    about : mapping
        What else stands in it, such as the versions.
    """
    files = {name: _entry(*digest(folder / name)) for name in sorted(_names(folder))}
    _write(folder, {**about, "files": files})


def rewrite(folder: Path, name: str, content: bytes) -> None:
    """Replace a file of a run folder, and what its manifest says of it, if it has one.

    The manifest comes first and knows the earlier file too: it holds whenever the machine stops.

    Parameters
    ----------
    folder : Path
        Run folder.
    name : str
        File, below the folder.
    content : bytes
        What it holds from then on.
    """
    manifest = read_manifest(folder)
    if manifest is not None:
        entry = _entry(hashlib.sha256(content).hexdigest(), len(content))
        if (folder / name).is_file():
            entry["replaces"] = digest(folder / name)[0]
        manifest["files"][name] = entry
        _write(folder, manifest)
    (folder / name).parent.mkdir(exist_ok=True)
    write_bytes(folder / name, content)


def read_manifest(folder: Path) -> dict[str, Any] | None:
    """Return the manifest of a run folder, None if it has none that can be understood."""
    try:
        manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    files = manifest.get("files") if isinstance(manifest, dict) else None
    return manifest if isinstance(files, dict) and all(isinstance(entry, dict) for entry in files.values()) else None


def strangers(folder: Path) -> list[str]:
    """Return the files of a run folder that the manifest does not list, or that have changed since it was written.

    Parameters
    ----------
    folder : Path
        Run folder.

    Returns
    -------
    list of str
        Their names below the folder; without a manifest all of them.
    """
    manifest = read_manifest(folder)
    files = manifest["files"] if manifest else {}
    ours = [MANIFEST, *files] if manifest else []
    found = [name for name in _names(folder) if not _is_unfinished(name, ours)]
    return sorted(name for name in found if name not in ours or (name in files and not _is(folder / name, files[name])))


def digest(path: Path) -> tuple[str, int]:
    """Return the SHA-256 and the length [bytes] of a file."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest(), path.stat().st_size


def _entry(sha256: str, length: int) -> dict[str, Any]:
    return {"sha256": sha256, "bytes": length}


def _is(path: Path, entry: Mapping[str, Any]) -> bool:
    return path.is_file() and digest(path)[0] in {entry.get("sha256"), entry.get("replaces")}


def _write(folder: Path, manifest: Mapping[str, Any]) -> None:
    write_text(folder / MANIFEST, json.dumps(manifest, indent=2) + "\n")


def _names(folder: Path) -> Iterator[str]:
    """Yield everything below `folder` that is no folder, and the empty folders."""
    for root, folders, files in os.walk(folder):
        here = Path(root)
        links = [name for name in folders if (here / name).is_symlink()]
        for name in (*files, *links):
            if name not in _NOBODYS:
                yield (here / name).relative_to(folder).as_posix()
        if not folders and not files and here != folder:
            yield here.relative_to(folder).as_posix()


def _is_unfinished(name: str, ours: list[str]) -> bool:
    """Return whether a process left it that died while it wrote one of our files."""
    return any(is_partial(name, one) for one in ours)
