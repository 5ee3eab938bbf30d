"""``docs``: opens the documentation in a browser."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ros_visualise.commands import Command
from ros_visualise.core.errors import OpenError, did_you_mean
from ros_visualise.core.printing import print_result
from ros_visualise.running.arguments import argument, option

PACKAGE = Path(__file__).parents[1]
SITES = (PACKAGE / "site", PACKAGE.parents[1] / "docs" / "_build" / "html")
"""Folders of the built documentation: in an installed package, and in a clone."""


@dataclass(frozen=True)
class DocsOptions:
    """Options of ``docs``."""

    page: str | None = argument(
        "a page, such as filters or first-film (default: the first one)",
        default=None,
        nargs="?",
        metavar="PAGE",
    )
    no_open: bool = option(False, "print the address without opening a browser")


def run(options: DocsOptions) -> int:
    """Open a page of the documentation, and print its address."""
    import webbrowser

    address = _page(_site(), options.page).as_uri()
    if not options.no_open:
        webbrowser.open(address)
    print_result([address])
    return 0


def _site() -> Path:
    for site in SITES:
        if (site / "index.html").is_file():
            return site
    raise OpenError("the documentation is not built; in a clone of the repository run: make docs")


def _page(site: Path, name: str | None) -> Path:
    if name is None:
        return site / "index.html"
    pages = {_name(site, path): path for path in sorted(site.rglob("*.html"), reverse=True)}
    if name not in pages:
        hint = did_you_mean(name, pages, listed=False)
        raise OpenError(f"no page {name!r} in the documentation{hint}")
    return pages[name]


def _name(site: Path, page: Path) -> str:
    """Name of a page's file, or of the folder whose index it is."""
    is_index = page.stem == "index" and page.parent != site
    return page.parent.name if is_index else page.stem


COMMAND = Command("open the documentation in a browser", DocsOptions, run)
