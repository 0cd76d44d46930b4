"""How the site is built: `make docs` writes it to docs/_build/html, without network, every warning an error."""

from __future__ import annotations

import re
import sys
import warnings
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

from generated import write_pages
from sphinx.errors import ExtensionError

import testbed

project = "testbed"
author = "the testbed's authors"
release = version = testbed.__version__
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "numpydoc",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = ["_build", "gallery/*.ipynb", "gallery/*.py"]
# Pages link to files of the repository that are no pages; they are offered as they are.
suppress_warnings = ["config.cache"]

myst_enable_extensions = ["dollarmath", "deflist", "colon_fence"]
myst_heading_anchors = 3

autodoc_typehints = "none"
autodoc_member_order = "bysource"
autosummary_generate = True
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True

# Nothing is fetched from elsewhere, by the build or by who reads it.
mathjax_path = "mathjax/tex-svg.js"
html_theme = "pydata_sphinx_theme"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_title = f"testbed {release}"
html_show_sourcelink = False
html_context = {"default_mode": "auto"}
html_theme_options = {
    "show_toc_level": 2,
    "navigation_with_keys": False,
    # Sixty pages do not fit into a bar; they stand beside each page, under the headings of index.md.
    "navbar_center": [],
    "globaltoc_includehidden": True,
    "navbar_end": ["theme-switcher"],
    "footer_start": [],
    "footer_end": [],
    "secondary_sidebar_items": ["page-toc"],
}
html_sidebars = {"**": ["globaltoc.html"]}
linkcheck_timeout = 20

sphinx_gallery_conf = {
    "examples_dirs": [str(HERE.parent / "examples" / "gallery")],
    "gallery_dirs": ["gallery"],
    "abort_on_example_error": True,
    "download_all_examples": False,
    "show_memory": False,
    "show_signature": False,
    "write_computation_times": False,
    "min_reported_time": 1e9,
    "within_subsection_order": "FileNameSortKey",
    "image_scrapers": ("matplotlib",),
    "matplotlib_animations": False,
    "reset_modules": ("matplotlib",),
    # Two scripts at a time; the worker processes of joblib, which comes with scikit-learn.
    "parallel": 2,
    "default_thumb_file": None,
}
# The gallery's backend draws nothing on a screen, which plt.show says.
warnings.filterwarnings("ignore", message=".*non-GUI backend.*", category=UserWarning)


_FETCHED = re.compile(r"<(?:script|img|iframe)[^>]* src=\"https?:[^\"]*|<link[^>]* href=\"https?:[^\"]*")
# Pages of the repository that have their place on the site under another name.
_MOVED = {"../README.md": "index.md", "../CONTRIBUTING.md": "contributing.md", "../SECURITY.md": "security.md"}


def moved(_app: Any, _name: str, source: list[str]) -> None:
    """Point links to the repository's own pages at the site's."""
    for link, page in _MOVED.items():
        source[0] = source[0].replace(f"]({link}", f"]({page}")


def refuse_fetches(app: Any, failed: Exception | None) -> None:
    """End the build with an error if a page would load a script, a style or a picture from elsewhere."""
    if failed is None and app.builder.name == "html":
        pages = {str(path.relative_to(app.outdir)): path.read_text("utf-8") for path in app.outdir.rglob("*.html")}
        found = [f"{name}: {text}" for name, page in pages.items() for text in _FETCHED.findall(page)]
        if found:
            raise ExtensionError("pages that fetch from elsewhere:\n" + "\n".join(found))


def setup(app: Any) -> None:
    """Write the pages that follow from the code before Sphinx looks for pages."""
    app.connect("config-inited", lambda _app, _config: write_pages(HERE / "reference" / "generated"))
    app.connect("source-read", moved)
    app.connect("build-finished", refuse_fetches)
