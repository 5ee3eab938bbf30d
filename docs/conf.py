"""The site: Sphinx with furo and MyST; `make docs` builds it."""

import os
import sys
from pathlib import Path

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS))

import generated  # noqa: E402
import links  # noqa: E402

project = "ros_visualise"
author = "the authors of ros_visualise"
version = release = generated.version()
html_title = f"ros_visualise {version}"

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["_build"]
smartquotes = False  # options begin with two hyphens
myst_heading_anchors = 4
autodoc_typehints = "description"
linkcheck_ignore = [r"https?://(127\.0\.0\.1|robot).*"]

html_theme = "furo"
html_static_path: list[str] = []
html_show_copyright = False
if links.REPOSITORY:
    html_theme_options = {
        "source_repository": f"{links.REPOSITORY}/",
        "source_branch": "main",
        "source_directory": "docs/",
    }
html_search_scorer = str(DOCS / "scorer.js")
pygments_style = "friendly"
pygments_dark_style = "github-dark"


def setup(app):
    """Make pages from declarations, and rewrite links that leave this folder."""
    is_quick = bool(os.environ.get("QUICK"))
    app.connect("builder-inited", lambda app: generated.write(lessons=not is_quick))
    if is_quick:
        app.connect("html-page-context", _without_tree, priority=400)  # before the theme's
    app.connect("source-read", links.resolve)
    app.connect("html-page-context", _without_edit)


def _without_tree(app, name, template, context, doctree):
    """The tree of all pages beside each page, which takes most of the time of a build."""
    context["toctree"] = lambda **_: ""


def _without_edit(app, name, template, context, doctree):
    """A generated page has no source that could be edited."""
    if name.startswith("generated/"):
        context["page_source_suffix"] = ""
