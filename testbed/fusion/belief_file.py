"""A belief in a file of its own, as `testbed identify` writes it: sensors by name, values with their units."""

from __future__ import annotations

from pathlib import Path

from testbed.document import Document
from testbed.fusion.belief import SensorBelief


def is_belief_file(source: str) -> bool:
    """Return whether a belief is given as a file, by its name."""
    return Path(source).suffix.lower() in {".yaml", ".yml"}


def read_belief(path: Path) -> dict[str, SensorBelief]:
    """Return the belief of each sensor that a YAML file names.

    Parameters
    ----------
    path : Path
        The file.

    Raises
    ------
    ScenarioError
        If it cannot be read, or something in it is wrong, with the line; all at once.
    """
    document = Document(path, "belief (a mapping for each sensor)")
    found = {
        str(name): document.validate(SensorBelief, value, (name,), path.parent) for name, value in document.data.items()
    }
    document.refuse()
    return {name: one.model_copy(update={"source": path.name}) for name, one in found.items() if one is not None}
