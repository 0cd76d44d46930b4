"""What every part of a scenario is read by: entries that should be mappings, names and kinds; findings are noted."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from testbed.errors import quoted

if TYPE_CHECKING:
    from testbed.document import Document, Key


def mapping(document: Document, data: Any, key: Key) -> dict[str, Any]:
    """Return the mapping at `key`; an empty one for nothing, and, with the finding noted, for anything else."""
    if data is None:
        return {}
    if not isinstance(data, dict):
        document.find(key, f"expected a mapping, got {quoted(data)}")
        return {}
    return data


def is_name(document: Document, name: Any, key: Key) -> bool:
    """Return whether an instance may be called so; the finding is noted if not."""
    if isinstance(name, str) and re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]{0,63}", name):
        return True
    document.find(key, f"expected a name of at most 64 letters, digits and underscores, got {quoted(name)}")
    return False


def kind_of(document: Document, given: Any, key: Key) -> str | None:
    """Return the name of a part's kind; None, with the finding noted, if it is no name."""
    if isinstance(given, str):
        return given
    document.find((*key, "type"), f"expected a name, got {quoted(given)}")
    return None
