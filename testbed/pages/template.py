"""Pages from templates: one environment for the run report, the audit and the papers."""

from __future__ import annotations

from importlib import resources
from typing import TYPE_CHECKING, Any

from jinja2 import BytecodeCache, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from testbed.pages.numbers import bounded, fixed, plain, significant

if TYPE_CHECKING:
    from collections.abc import Mapping

    from jinja2.bccache import Bucket
    from matplotlib.figure import Figure


class _Compiled(BytecodeCache):
    """Templates as Jinja compiled them, for this process: that takes longer than filling one."""

    def __init__(self) -> None:
        self._known: dict[str, bytes] = {}

    def load_bytecode(self, bucket: Bucket) -> None:
        if bucket.key in self._known:
            bucket.bytecode_from_string(self._known[bucket.key])

    def dump_bytecode(self, bucket: Bucket) -> None:
        self._known[bucket.key] = bucket.bytecode_to_string()


_COMPILED = _Compiled()


def render(template: str, figures: Mapping[str, Figure | Markup], **values: Any) -> str:
    """Return a page; every name that reaches it is escaped, an unknown one is an error.

    Parameters
    ----------
    template : str
        File in `testbed/pages/templates`.
    figures : mapping of str to Figure or Markup
        Reach the template as `figures`, SVG by name, in the order in which it shows them: `figure_number` counts them.
    **values : Any
        What else the template shows or calls.
    """
    environment = Environment(
        loader=PackageLoader("testbed.pages"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        bytecode_cache=_COMPILED,
    )
    environment.globals["vendored"] = _vendored
    environment.filters |= {"significant": significant, "bounded": bounded, "fixed": fixed, "plain": plain}
    # Globals, so that the macros of a template see them too.
    environment.globals |= {**values, "figure_number": {name: number for number, name in enumerate(figures, 1)}}
    # Markup: text in a figure is drawn as outlines, so no name reaches the page unescaped.
    drawn = {
        name: figure if isinstance(figure, Markup) else Markup(_svg_text(figure, name))
        for name, figure in figures.items()
    }
    return environment.get_template(template).render(figures=drawn)


def _svg_text(figure: Figure, name: str) -> str:
    from testbed.pages.svg import svg_text  # matplotlib, which not every page needs

    return svg_text(figure, name)


def _vendored(name: str) -> Markup:
    """Return a script or style that stands beside the templates, as it is."""
    # Markup: a file of this package.
    return Markup((resources.files("testbed.pages") / "templates" / name).read_text(encoding="utf-8"))
