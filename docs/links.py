"""Links that leave the folder of the site: to the page of a file, else to the repository."""

import posixpath
import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
REPOSITORY = "https://github.com/OWNER/ros_visualise"
PAGES = {
    "benchmarks/README.md": "generated/benchmarks.md",
    "benchmarks/ros2/README.md": "generated/benchmarks_ros2.md",
    "training/README.md": "generated/training.md",
    "CONTRIBUTING.md": "generated/contributing.md",
}
"""A text of the repository -> its page of the site."""

_LINK = re.compile(r"\]\((?!https?:|#|/|mailto:)([^)\s#]+)(#[^)\s]*)?\)")


def resolve(app, name, source):
    """Rewrite the links of a page that was read."""
    source[0] = rewritten(source[0], f"docs/{name}.md")


def rewritten(text: str, path: str) -> str:
    """The text with links for its place in the site.

    Args:
        text: Markdown.
        path: its file, from the root of the repository, which its links are relative to.
    """

    def place(found: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join(posixpath.dirname(path), found[1]))
        anchor = found[2] or ""
        if target in PAGES:
            return f"](/{PAGES[target]}{anchor})"
        if target.startswith("docs/"):
            return f"](/{target.removeprefix('docs/')}{anchor})"
        if not (ROOT / target).exists():
            raise ValueError(f"{path}: a link leads nowhere: {found[1]}")
        kind = "tree" if (ROOT / target).is_dir() else "blob"
        return f"]({REPOSITORY}/{kind}/main/{target}{anchor})"

    return _LINK.sub(place, text)
