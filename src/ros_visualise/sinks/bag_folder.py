"""The folder of a ROS 2 bag: how a new one is made, and which old one it may replace."""

from __future__ import annotations

import glob
import logging
import os
import re
import stat
from collections.abc import Iterable
from pathlib import Path

from mcap.writer import MCAP0_MAGIC

from ros_visualise.core.errors import OpenError
from ros_visualise.core.regular_files import open_file
from ros_visualise.core.yaml_files import BadYaml, load_yaml
from ros_visualise.sinks.targets import Target, sync, take_over
from ros_visualise.sources.recordings.metadata import METADATA

log = logging.getLogger(__name__)

_BEGINNINGS = {
    ".mcap": MCAP0_MAGIC,
    ".db3": b"SQLite format 3\0",
    ".zstd": b"\x28\xb5\x2f\xfd",
}
"""How a bag's files end -> how they begin."""
_ASIDE = ".old-"
_ADVICE = "rename it to have it back, or delete it"


class BagFolder(Target):
    """A new folder for files of messages and their ``metadata.yaml``.

    It replaces only a ROS 2 bag in which there is nothing else, or an empty folder.

    Raises:
        OpenError: as `Target`.
    """

    def __init__(self, path: Path, overwrite: bool) -> None:
        super().__init__(path, overwrite)
        for aside in sorted(path.parent.glob(f"{glob.escape(path.name)}{_ASIDE}*")):
            log.warning("%s is what %s was before a run that was killed; %s", aside, path, _ADVICE)

    def file(self, number: int) -> Path:
        """Where messages are; the first file is number 0."""
        return self.path / f"{self._place.name}_{number}.mcap"

    @classmethod
    def _check_old(cls, path: Path) -> None:
        if not path.is_dir():
            raise OpenError(f"{path}: is a file; choose another name for a ROS 2 bag's folder")
        if _files_of_bag(path) is None:
            raise OpenError(f"{path}: holds more than a ROS 2 bag; choose another name")

    def _create(self, path: Path) -> Path:
        path.mkdir(0o700 if self.replaces else 0o777)
        return path

    def _sync(self) -> None:
        for file in self.path.iterdir():
            sync(file)
        sync(self.path)

    def _replace(self, old: Path) -> None:
        """Move the old one aside, for no call swaps folders on all systems; delete it then.

        Only then may others than its owner look into the new one, if they could into the old one.
        """
        if not old.exists():
            os.rename(self.path, old)
            return
        names = _files_of_bag(old)
        if names is None:
            raise OSError(f"{old.name} holds something else by now")
        self._take_over(old, names)
        aside = old.with_name(f"{old.name}{_ASIDE}{os.getpid()}")
        os.rename(old, aside)
        try:
            os.rename(self.path, old)
        except OSError:
            os.rename(aside, old)
            raise
        _delete(aside, names)

    def _take_over(self, old: Path, names: Iterable[str]) -> None:
        """Give it the rights of the old one, and its files those of the least open one there."""
        files = [(old / name).stat() for name in names]
        if files:
            least = min(files, key=lambda about: stat.S_IMODE(about.st_mode))
            for file in self.path.iterdir():
                take_over(file, least)
        take_over(self.path, old.stat())

    def _delete(self) -> None:
        names = [file.name for file in self.path.iterdir()]
        _delete(self.path, [*_own_files(self._place, names), METADATA])


def _own_files(folder: Path, names: Iterable[str]) -> set[str]:
    """Those that a recorder of ours calls so."""
    own = re.compile(f"{re.escape(folder.name)}_\\d+\\.mcap")
    return {name for name in names if own.fullmatch(name)}


def _delete(folder: Path, names: Iterable[str]) -> None:
    for name in names:
        (folder / name).unlink(missing_ok=True)
    try:
        folder.rmdir()
    except OSError:
        log.warning("%s is kept: somebody put a file into it", folder)


def _files_of_bag(folder: Path) -> set[str] | None:
    """What is in a ROS 2 bag, or in what a recorder leaves if it is killed.

    Returns:
        the names of all files; None where there is anything else.

    Raises:
        OSError: it may not be looked into.
    """
    with os.scandir(folder) as found:
        items = list(found)
    names = {item.name for item in items}
    if not all(item.is_file(follow_symlinks=False) for item in items):
        return None
    parts = names - {METADATA}
    listed = _listed(folder / METADATA) if METADATA in names else _own_files(folder, parts)
    is_bag = parts == listed and all(_holds_messages(folder / name) for name in parts)
    return names if is_bag else None


def _holds_messages(file: Path) -> bool:
    """Whether it is what it is called, and may be a file of a bag."""
    kind = Path(file.stem).suffix if file.suffix == ".zstd" else file.suffix
    begins = _BEGINNINGS.get(file.suffix, b"")
    with open_file(file) as content:
        return kind in (".mcap", ".db3") and content.read(len(begins)) == begins


def _listed(metadata: Path) -> set[str] | None:
    """The files of which a bag says that it consists; None where that cannot be read."""
    try:
        names = load_yaml(metadata)["rosbag2_bagfile_information"]["relative_file_paths"]
        return {re.split(r"[/\\]", name)[-1] for name in names}
    except (BadYaml, LookupError, TypeError):
        return None
