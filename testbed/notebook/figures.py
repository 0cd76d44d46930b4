"""Figures that a notebook shows without being asked."""

from __future__ import annotations

from typing import TYPE_CHECKING

from testbed.pages.svg import svg_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Figures(dict[str, "Figure"]):
    """Matplotlib figures by name; as the result of a cell all of them are shown."""

    def _repr_html_(self) -> str:
        # Names inside a drawing must differ from those of any other cell of the page.
        return "".join(f"<div>{svg_text(figure, f'{name}-{id(self):x}')}</div>" for name, figure in self.items())
