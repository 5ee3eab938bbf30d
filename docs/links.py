"""Links that leave the folder of the site: to the page of a file, else to the file itself."""

import posixpath
import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[1]
_PUBLIC = re.compile(r"(?:https://(?:[^@/]*@)?|git@)((?:github|gitlab)\.com)[/:](.+?)(?:\.git)?/?")


def _repository() -> str:
    """Public address that this was cloned from; empty if there is none."""
    try:
        asked = ["git", "-C", ROOT, "config", "remote.origin.url"]
        told = subprocess.run(asked, capture_output=True, text=True).stdout.strip()
    except OSError:  # no git
        return ""
    found = _PUBLIC.fullmatch(told)
    return f"https://{found[1]}/{found[2]}" if found else ""


REPOSITORY = _repository()
PAGES = {
    "benchmarks/README.md": "generated/benchmarks.md",
    "benchmarks/ros2/README.md": "generated/benchmarks_ros2.md",
    "training/README.md": "generated/training.md",
    "CONTRIBUTING.md": "generated/contributing.md",
}
"""A text of the repository -> its page of the site."""

_LINK = re.compile(r"\[([^][]*)\]\((?!https?:|#|/|mailto:)([^)\s#]+)(#[^)\s]*)?\)")


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
        text, file, anchor = found[1], found[2], found[3] or ""
        target = posixpath.normpath(posixpath.join(posixpath.dirname(path), file))
        if target in PAGES:
            return f"[{text}](/{PAGES[target]}{anchor})"
        if target.startswith("docs/"):
            return f"[{text}](/{target.removeprefix('docs/')}{anchor})"
        if (ROOT / target).is_file() and not target.endswith(".md"):
            return f"[{text}](/../{target})"  # Sphinx copies it into the site
        if not (ROOT / target).exists():
            raise ValueError(f"{path}: a link leads nowhere: {file}")
        return f"[{text}]({REPOSITORY}/tree/main/{target})" if REPOSITORY else text

    return _LINK.sub(place, text)
