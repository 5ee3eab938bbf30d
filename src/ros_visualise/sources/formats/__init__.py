"""Formats of recordings, one in each file: how one is recognised and opened.

A format is recognised by the beginning of a file or the content of a folder; names decide only what
the page offers, and what a damaged file was meant to be. Readers are imported when
something is opened, so that asking for all suffixes costs little.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ros_visualise.core.registry import Registry, holding

if TYPE_CHECKING:
    from ros_visualise.sources.recordings import Recording

VIDEOS = (".avi", ".m4v", ".mkv", ".mov", ".mp4", ".mpeg", ".mpg", ".ts", ".webm")
"""Extensions by which videos are found in folders; a file that is given may have any."""


def lazily(target: str) -> Callable[..., Any]:
    """A function ``package.module:name`` below this package, whose module is imported on a call."""
    module, _, name = target.partition(":")

    def call(*arguments: Any) -> Any:
        return getattr(import_module(f"ros_visualise.sources.{module}"), name)(*arguments)

    return call


def _never(_: object) -> bool:
    return False


@dataclass(frozen=True)
class Format:
    """A format of recordings.

    Attributes:
        name: for people: ``ROS 1 bag``.
        open: opens a file or folder of it; raises OpenError.
        suffixes: of its files' names, in lower case.
        begins: true for the first 4096 bytes, or fewer, of one.
        is_folder: true for a folder that is one.
        is_within: true for a folder with one somewhere below; asked if nothing else fits.
        whole_of: the whole recording that a folder is a part of, if it is one.
        is_series: true for the files of a folder that are the parts of one.
    """

    name: str
    open: Callable[[Path], Recording]
    suffixes: tuple[str, ...] = ()
    begins: Callable[[bytes], bool] = _never
    is_folder: Callable[[Path], bool] = _never
    is_within: Callable[[Path], bool] = _never
    whole_of: Callable[[Path], Path | None] = lambda _: None
    is_series: Callable[[Sequence[Path]], bool] = _never


FORMATS = Registry(
    "formats", __name__, holding(Format, "FORMAT"), first=("rosbag1", "mcap", "rosbag2", "kitti")
)


def format_of(head: bytes) -> Format | None:
    """The format of a file that begins so, if known."""
    return next((one for one in FORMATS.all() if one.begins(head)), None)


def suffixes() -> tuple[str, ...]:
    """Suffixes of the names of all formats' files, in lower case."""
    return tuple(suffix for one in FORMATS.all() for suffix in one.suffixes)


def named(path: Path) -> str:
    """The format that a file's extension stands for; empty: none."""
    suffix = path.suffix.lower()
    return next((one.name for one in FORMATS.all() if suffix in one.suffixes), "")


def kinds() -> str:
    """All formats, for people: ``.bag, .mcap, .db3, KITTI folder``."""
    return ", ".join(" or ".join(one.suffixes) or one.name for one in FORMATS.all())
