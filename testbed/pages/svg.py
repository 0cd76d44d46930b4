"""Figures as SVG text that follows the page's text color, so that they read on light and on dark; and their style."""

from __future__ import annotations

import io
import re
from typing import TYPE_CHECKING, Any

import matplotlib as mpl

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Stands for the page's text color: `svg_text` replaces it by currentColor.
INK = "#010203"
STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.labelsize": 9.0,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-4, 5),
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "grid.color": INK,
    "grid.alpha": 0.13,
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.handlelength": 2.4,
    "path.simplify": True,
    "svg.fonttype": "path",
}


# What a figure is written as for use elsewhere, and what would make two drawings of one run differ.
FORMATS = ("svg", "pdf", "png")
_UNDATED: dict[str, dict[str, None]] = {
    "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
    "png": {"Software": None},
}
_DPI = 300


def figure_bytes(figure: Figure, kind: str) -> bytes:
    """Return a figure as a file on white: SVG and PDF with the letters as curves or embedded, PNG of 300 dots an inch.

    Parameters
    ----------
    figure : Figure
        Drawn with `STYLE`.
    kind : {"svg", "pdf", "png"}
        Format.
    """
    buffer = io.BytesIO()
    with mpl.rc_context({**STYLE, "svg.hashsalt": "figure", "pdf.fonttype": 42}):
        figure.savefig(buffer, format=kind, dpi=_DPI, facecolor="white", metadata=_UNDATED[kind])
    return buffer.getvalue()


def svg_text(figure: Figure, name: str) -> str:
    """Return `figure` as an ``<svg>`` element for a page that holds several.

    Parameters
    ----------
    figure : Figure
        Drawn with `INK` for text and axes.
    name : str
        Prefix of every id, unique in the page.

    Returns
    -------
    str
        The element; no XML head, no date, no fonts needed; equal input gives equal text.
    """
    buffer = io.StringIO()
    with mpl.rc_context({**STYLE, "svg.hashsalt": name}):
        figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    svg = buffer.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{name}-", svg)
    svg = re.sub(r'(<svg[^>]*?) width="[^"]*"', r"\1", svg, count=1, flags=re.DOTALL)
    svg = re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", svg, count=1, flags=re.DOTALL)
    svg = re.sub(r'\bd="[^"]*"', lambda path: _shorter(path[0]), svg)
    return svg.replace(INK, "currentColor").strip()


def _shorter(path: str) -> str:
    """Round the coordinates of a path to 0.1 pt and leave out repeated commands: a third of the text, no difference to
    the eye.
    """
    path = re.sub(r"-?\d+\.\d{2,}", lambda number: f"{float(number[0]):.1f}", path).replace("\n", "")
    has_curves = re.search("[CQ]", path)
    return path if has_curves else path.replace(" L ", " ")
