"""What the command line says, where the terminal or the file does not take every character."""

from __future__ import annotations

import codecs
import io
from typing import TextIO

# What the field writes with characters that not every terminal has.
_PLAIN = {
    "²": "^2",
    "³": "^3",
    "µ": "u",
    "μ": "u",
    "·": "*",
    "×": "x",
    "√": "sqrt",
    "±": "+/-",
    "−": "-",
    "–": "-",
    "—": "-",
    "…": "...",
    "°": "deg",
    "≤": "<=",
    "≥": ">=",
    "→": "->",
}


def speak_any_encoding(*streams: TextIO) -> None:
    """Let streams write what they cannot encode in plain letters, or as its number, instead of an exception."""
    codecs.register_error("testbed", _plainly)
    for stream in streams:
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="testbed")


def _plainly(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text = error.object[error.start : error.end]
    plain = "".join(_PLAIN.get(letter, letter.encode("ascii", "backslashreplace").decode()) for letter in text)
    return plain, error.end
