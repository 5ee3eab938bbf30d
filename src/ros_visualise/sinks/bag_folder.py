"""The folder of a ROS 2 bag: how a new one is made, and which old one it may replace."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from ros_visualise.errors import OpenError
from ros_visualise.sinks.targets import Target, sync
from ros_visualise.yaml_files import BadYaml, load_yaml

METADATA = "metadata.yaml"


class BagFolder(Target):
    """A new folder for one file and its ``metadata.yaml``.

    It replaces only a ROS 2 bag in which there is nothing else, or an empty folder.

    Raises:
        OpenError: as `Target`.
    """

    @property
    def file(self) -> Path:
        """Where the messages are."""
        return self.path / _only_file(self._place)

    @classmethod
    def _check_old(cls, path: Path) -> None:
        if not path.is_dir():
            raise OpenError(f"{path}: is a file; choose another name for a ROS 2 bag's folder")
        if not _is_bag(path):
            raise OpenError(f"{path}: holds more than a ROS 2 bag; choose another name")

    def _create(self, path: Path) -> Path:
        path.mkdir()
        return path

    def _sync(self) -> None:
        for file in self.path.iterdir():
            sync(file)
        sync(self.path)

    def _replace(self, old: Path) -> None:
        """Move the old one aside, for no call swaps folders on all systems; delete it then."""
        if not old.exists():
            os.rename(self.path, old)
            return
        if not _is_bag(old):
            raise OSError(f"{old.name} holds something else by now")
        aside = old.with_name(f"{old.name}.old-{os.getpid()}")
        os.rename(old, aside)
        try:
            os.rename(self.path, old)
        except OSError:
            os.rename(aside, old)
            raise
        _delete(aside, [file.name for file in aside.iterdir()])

    def _delete(self) -> None:
        _delete(self.path, [self.file.name, METADATA])


def _only_file(folder: Path) -> str:
    return f"{folder.name}_0.mcap"


def _delete(folder: Path, names: Iterable[str]) -> None:
    for name in names:
        (folder / name).unlink(missing_ok=True)
    with suppress(OSError):  # somebody put a file into it
        folder.rmdir()


def _is_bag(folder: Path) -> bool:
    """Whether there is nothing in it but one ROS 2 bag, or what a recorder leaves if it is killed.

    Raises:
        OSError: it may not be looked into.
    """
    with os.scandir(folder) as found:
        items = list(found)
    names = {item.name for item in items}
    if not all(item.is_file(follow_symlinks=False) for item in items):
        return False
    if METADATA in names:
        return sorted(names - {METADATA}) == _listed(folder / METADATA)
    return names <= {_only_file(folder)}


def _listed(metadata: Path) -> list[str] | None:
    """The files of which a bag says that it consists; None where that cannot be read."""
    try:
        names = load_yaml(metadata)["rosbag2_bagfile_information"]["relative_file_paths"]
        return sorted(re.split(r"[/\\]", name)[-1] for name in names)
    except (BadYaml, LookupError, TypeError):
        return None
