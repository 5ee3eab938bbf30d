"""Recording to a ROS 2 bag: a folder of .mcap files and a metadata.yaml."""

from __future__ import annotations

import glob
import logging
import os
import re
import stat
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

from mcap.records import Metadata
from mcap.writer import MCAP0_MAGIC
from ruamel.yaml import YAML

from ros_visualise.core.errors import OpenError, RecordingError, RosVisualiseError
from ros_visualise.core.regular_files import open_file
from ros_visualise.core.yaml_files import BadYaml, load_yaml
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks import SinkSettings
from ros_visualise.sinks.encoding import numbered_qos
from ros_visualise.sinks.mcap_file import McapRecorder
from ros_visualise.sinks.parts import PartedRecorder, PartInfo, Split
from ros_visualise.sinks.targets import Target, sync, take_over
from ros_visualise.sources.recordings import Extra
from ros_visualise.sources.recordings.metadata import CUSTOM, METADATA

log = logging.getLogger(__name__)

_BEGINNINGS = {
    ".mcap": MCAP0_MAGIC,
    ".db3": b"SQLite format 3\0",
    ".zstd": b"\x28\xb5\x2f\xfd",
}
"""Suffix of a bag's file -> its first bytes."""
_ASIDE = ".old-"
_ADVICE = "rename it to restore it, or delete it"
_VERSION = 8  # what ROS 2 Iron writes, and later ones read


class BagFolder(Target):
    """A new folder for files of messages and their ``metadata.yaml``.

    It replaces only a ROS 2 bag without other files, or an empty folder.

    Raises:
        OpenError: as `Target`.
    """

    def __init__(self, path: Path, overwrite: bool) -> None:
        super().__init__(path, overwrite)
        for aside in sorted(path.parent.glob(f"{glob.escape(path.name)}{_ASIDE}*")):
            log.warning("%s is the old %s, left by a killed run; %s", aside, path, _ADVICE)

    def file(self, number: int) -> Path:
        """Path of a file of messages; the first one is number 0."""
        return self.path / f"{self._place.name}_{number}.mcap"

    @classmethod
    def _check_old(cls, path: Path) -> None:
        if not path.is_dir():
            raise OpenError(f"{path}: is a file; choose another name for the folder of a ROS 2 bag")
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
        """Move the old one aside, as no call swaps folders on all systems, and delete it then.

        Only then can others than its owner read the new one, if they could read the old one.
        """
        if not old.exists():
            os.rename(self.path, old)
            return
        names = _files_of_bag(old)
        if names is None:
            raise OSError(f"{old.name} was changed in the meantime")
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
        """Take over the permissions of the old folder, and for files the most restrictive there."""
        files = [(old / name).stat() for name in names]
        if files:
            least = min(files, key=lambda about: stat.S_IMODE(about.st_mode))
            for file in self.path.iterdir():
                take_over(file, least)
        take_over(self.path, old.stat())

    def _delete(self) -> None:
        names = [file.name for file in self.path.iterdir()]
        _delete(self.path, [*_own_files(self._place, names), METADATA])


class FolderRecorder(PartedRecorder):
    """Any number of topics in a ROS 2 bag with MCAP storage.

    Its metadata.yaml is written at the end; without it, the bag of a killed process is found by its
    .mcap files.

    Raises:
        DamagedMessage: a type that cannot be written.
        OpenError: as `BagFolder`.
    """

    def __init__(self, path: Path, topics: Mapping[str, TopicType], settings: SinkSettings) -> None:
        self._folder = BagFolder(path, settings.overwrite)
        self._custom: dict[str, str] = {}
        self._closed = False
        inner = replace(settings, overwrite=False, split=None)
        try:
            super().__init__(
                lambda number, types: McapRecorder(self._folder.file(number), types, inner),
                topics,
                settings.split or Split(),
            )
        except RosVisualiseError as error:
            self._folder.remove()
            raise type(error)(f"{error}{self._folder.fate}") from None

    @property
    def path(self) -> Path:
        return self._folder.path

    def add_extra(self, extra: Extra) -> None:
        if isinstance(extra, Metadata) and extra.name == CUSTOM:
            self._custom |= extra.metadata
            return
        with self._ending():
            super().add_extra(extra)

    def add(self, topic: str, kind: TopicType) -> None:
        with self._ending():
            super().add(topic, kind)

    def write(self, topic: str, message: Any, stamp_ns: int | None = None) -> None:
        with self._ending():
            super().write(topic, message, stamp_ns)

    def close(self, whole: bool = True) -> None:
        if self._closed:
            return
        self._closed = True
        with self._ending():
            super().close()
        try:
            self._write_metadata()
            self._folder.close(whole)
        except OSError as error:
            kept = sum(sum(part.counts.values()) for part in self.parts)
            raise self._folder.give_up(error, kept) from None

    def remove(self) -> None:
        self._folder.remove()

    @contextmanager
    def _ending(self) -> Iterator[None]:
        """End the folder if its file fails."""
        try:
            yield
        except RecordingError as error:
            self._closed = True
            with suppress(OSError):
                self._write_metadata()
            with suppress(OSError):
                self._folder.close(whole=False)
            if not any(part.path.exists() for part in self.parts):
                self._folder.remove()
            raise RecordingError(f"{error}{self._folder.fate}") from None

    def _write_metadata(self) -> None:
        text = StringIO()
        yaml = YAML(typ="safe", pure=True)
        yaml.default_flow_style = False
        yaml.width = 4096
        yaml.dump(self._describe(), text)
        (self.path / METADATA).write_text(text.getvalue(), "utf-8")

    def _describe(self) -> dict[str, Any]:
        parts = self.parts
        names = [part.path.name for part in parts]
        about = {
            "version": _VERSION,
            "storage_identifier": "mcap",
            "relative_file_paths": names,
            **_times(parts),
            "topics_with_message_count": [self._describe_topic(name) for name in self.topics],
            "compression_format": "",
            "compression_mode": "",
            "files": [
                {"path": name, **_times([part])} for name, part in zip(names, parts, strict=True)
            ],
            "custom_data": self._custom or None,
            "ros_distro": "ros_visualise",
        }
        return {"rosbag2_bagfile_information": about}

    def _describe_topic(self, name: str) -> dict[str, Any]:
        declared = self.declared[name]
        about = {
            "name": name,
            "type": declared.name,
            "serialization_format": "cdr",
            "offered_qos_profiles": numbered_qos(declared.offered_qos),
            "type_description_hash": declared.digest,
        }
        count = sum(part.counts.get(name, 0) for part in self.parts)
        return {"topic_metadata": about, "message_count": count}


def _times(parts: Sequence[PartInfo]) -> dict[str, Any]:
    """Start, duration and number of the messages in some files."""
    count = sum(sum(part.counts.values()) for part in parts)
    start_ns = min(part.start_ns for part in parts) if count else 0
    return {
        "starting_time": {"nanoseconds_since_epoch": start_ns},
        "duration": {"nanoseconds": max(part.end_ns for part in parts) - start_ns},
        "message_count": count,
    }


def _own_files(folder: Path, names: Iterable[str]) -> set[str]:
    """Files with names that our recorder uses."""
    own = re.compile(f"{re.escape(folder.name)}_\\d+\\.mcap")
    return {name for name in names if own.fullmatch(name)}


def _delete(folder: Path, names: Iterable[str]) -> None:
    for name in names:
        (folder / name).unlink(missing_ok=True)
    try:
        folder.rmdir()
    except OSError:
        log.warning("%s is kept: it contains other files", folder)


def _files_of_bag(folder: Path) -> set[str] | None:
    """Names of the files of a ROS 2 bag, or of one whose recorder was killed; None if it is no bag.

    Raises:
        OSError: the folder is not readable.
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
    """True if a file is one of a bag, by its name and its first bytes."""
    kind = Path(file.stem).suffix if file.suffix == ".zstd" else file.suffix
    begins = _BEGINNINGS.get(file.suffix, b"")
    with open_file(file) as content:
        return kind in (".mcap", ".db3") and content.read(len(begins)) == begins


def _listed(metadata: Path) -> set[str] | None:
    """The files listed in a bag's metadata; None if unreadable."""
    try:
        names = load_yaml(metadata)["rosbag2_bagfile_information"]["relative_file_paths"]
        return {re.split(r"[/\\]", name)[-1] for name in names}
    except (BadYaml, LookupError, TypeError):
        return None
