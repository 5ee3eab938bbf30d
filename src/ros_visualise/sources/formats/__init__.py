"""Formats of recordings, one in each file: how one is recognised, and how it is opened.

A format is recognised by what a file begins with or what a folder holds, never by a name: names
tell only what can be chosen on the page, and what a damaged file was meant to be. The modules here
import what they need when something is opened, so that to ask for all suffixes costs nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ros_visualise.core.registry import Registry, holding

if TYPE_CHECKING:
    from ros_visualise.sources.recordings import Recording


def _never(_: object) -> bool:
    return False


def _nothing(_: object) -> None:
    return None


@dataclass(frozen=True)
class Format:
    """A format of recordings.

    Attributes:
        name: what a file or folder of it is: ``ROS 1 bag``.
        open: opens a file or folder of it; raises OpenError.
        suffixes: of the names of its files, in lower case.
        begins: whether a file with these first 4096 bytes, or fewer, is one.
        is_folder: whether a folder is one.
        is_within: whether one is somewhere below a folder; asked where nothing else fits.
        whole_of: the folder of which this one is a part, if it is one.
        is_series: whether several files in one folder are the parts of one.
    """

    name: str
    open: Callable[[Path], Recording]
    suffixes: tuple[str, ...] = ()
    begins: Callable[[bytes], bool] = _never
    is_folder: Callable[[Path], bool] = _never
    is_within: Callable[[Path], bool] = _never
    whole_of: Callable[[Path], Path | None] = _nothing
    is_series: Callable[[Sequence[Path]], bool] = _never


FORMATS = Registry(
    "formats", __name__, holding(Format, "FORMAT"), first=("rosbag1", "mcap", "rosbag2", "kitti")
)


def format_of(head: bytes) -> Format | None:
    """The format of a file that begins so; None: unknown."""
    return next((one for one in FORMATS.all() if one.begins(head)), None)


def suffixes() -> tuple[str, ...]:
    """Suffixes of the names of all formats' files, in lower case."""
    return tuple(suffix for one in FORMATS.all() for suffix in one.suffixes)


def named(path: Path) -> str:
    """What a file's name says that it is; empty where it says nothing."""
    suffix = path.suffix.lower()
    return next((one.name for one in FORMATS.all() if suffix in one.suffixes), "")


def kinds() -> str:
    """All formats, for people: ``.bag, .mcap, .db3, KITTI folder``."""
    return ", ".join(" or ".join(one.suffixes) or one.name for one in FORMATS.all())
