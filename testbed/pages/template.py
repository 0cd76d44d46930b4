"""Pages from templates: one environment for the run report, the audit and the papers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from testbed.pages.numbers import bounded, fixed, plain, significant
from testbed.pages.svg import svg_text

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure


def render(template: str, figures: Mapping[str, Figure], **values: Any) -> str:
    """Return a page; every name that reaches it is escaped, an unknown one is an error.

    Parameters
    ----------
    template : str
        File in `testbed/pages/templates`.
    figures : mapping of str to Figure
        Reach the template as `figures`, SVG by name.
    **values : Any
        What else the template shows or calls.
    """
    environment = Environment(
        loader=PackageLoader("testbed.pages"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"significant": significant, "bounded": bounded, "fixed": fixed, "plain": plain}
    # Globals, so that the macros of a template see them too.
    environment.globals |= values
    # Markup: text in a figure is drawn as outlines, so no name reaches the page unescaped.
    drawn = {name: Markup(svg_text(figure, name)) for name, figure in figures.items()}
    return environment.get_template(template).render(figures=drawn)
