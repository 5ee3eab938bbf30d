"""Recording to a folder as rosbag2 writes it: .mcap files, and metadata.yaml beside them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

from mcap.records import Metadata
from ruamel.yaml import YAML

from ros_visualise.core.errors import RecordingError, RosVisualiseError
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks import Settings
from ros_visualise.sinks.bag_folder import BagFolder
from ros_visualise.sinks.mcap_file import McapRecorder
from ros_visualise.sinks.parts import Part, PartedRecorder, Split
from ros_visualise.sinks.qos_profiles import in_numbers, offered_qos
from ros_visualise.sources.recordings import Extra
from ros_visualise.sources.recordings.metadata import CUSTOM, METADATA

_VERSION = 8  # what ROS 2 Iron writes, and later ones read


class FolderRecorder:
    """Any number of topics in a ROS 2 bag with MCAP storage.

    Its metadata.yaml is written at the end; one that was killed before is found by its .mcap.

    Raises:
        DamagedMessage: a type that cannot be written.
        OpenError: as `BagFolder`.
    """

    def __init__(self, path: Path, topics: Mapping[str, TopicType], settings: Settings) -> None:
        self._folder = BagFolder(path, settings.overwrite)
        inner = replace(settings, overwrite=False, split=None)
        try:
            self._recorder = PartedRecorder(
                lambda number, types: McapRecorder(self._folder.file(number), types, inner),
                topics,
                settings.split or Split(),
            )
        except RosVisualiseError as error:
            self._folder.remove()
            raise type(error)(f"{error}{self._folder.fate}") from None
        self._custom: dict[str, str] = {}
        self._closed = False

    @property
    def path(self) -> Path:
        """As `ros_visualise.sinks.Recorder`."""
        return self._folder.path

    @property
    def files(self) -> int:
        """As `ros_visualise.sinks.Recorder`."""
        return self._recorder.files

    @property
    def haste(self) -> bool:
        """As `ros_visualise.sinks.Recorder`."""
        return self._recorder.haste

    @haste.setter
    def haste(self, haste: bool) -> None:
        self._recorder.haste = haste

    @property
    def topics(self) -> tuple[str, ...]:
        """As `ros_visualise.sinks.Recorder`."""
        return self._recorder.topics

    @property
    def unplaced(self) -> Mapping[str, int]:
        """As `ros_visualise.sinks.Recorder`."""
        return self._recorder.unplaced

    def add_extra(self, extra: Extra) -> None:
        """As `ros_visualise.sinks.Recorder`."""
        if isinstance(extra, Metadata) and extra.name == CUSTOM:
            self._custom |= extra.metadata
            return
        with self._ending():
            self._recorder.add_extra(extra)

    def add(self, topic: str, kind: TopicType) -> None:
        """As `ros_visualise.sinks.Recorder`."""
        with self._ending():
            self._recorder.add(topic, kind)

    def write(self, topic: str, message: Any, stamp_ns: int | None = None) -> None:
        """As `ros_visualise.sinks.Recorder`."""
        with self._ending():
            self._recorder.write(topic, message, stamp_ns)

    def close(self, whole: bool = True) -> None:
        """Finish the file and describe it; more than once does no harm."""
        if self._closed:
            return
        self._closed = True
        with self._ending():
            self._recorder.close()
        try:
            self._write_metadata()
            self._folder.close(whole)
        except OSError as error:
            kept = sum(sum(part.counts.values()) for part in self._recorder.parts)
            raise self._folder.give_up(error, kept) from None

    def remove(self) -> None:
        """As `ros_visualise.sinks.Recorder`."""
        self._folder.remove()

    @contextmanager
    def _ending(self) -> Iterator[None]:
        """Where its file cannot go on, it ends."""
        try:
            yield
        except RecordingError as error:
            self._closed = True
            with suppress(OSError):
                self._write_metadata()
            with suppress(OSError):
                self._folder.close(whole=False)
            if not any(part.path.exists() for part in self._recorder.parts):
                self._folder.remove()
            raise RecordingError(f"{error}{self._folder.fate}") from None

    def _write_metadata(self) -> None:
        text = StringIO()
        yaml = YAML(typ="safe", pure=True)
        yaml.default_flow_style = False
        yaml.width = 4096
        yaml.dump(self._describe(), text)
        (self.path / METADATA).write_text(text.getvalue(), "utf-8")

    def __enter__(self) -> FolderRecorder:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self.close(whole=kind is None)

    def _describe(self) -> dict[str, Any]:
        parts = self._recorder.parts
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
        declared = self._recorder.declared[name]
        about = {
            "name": name,
            "type": declared.name,
            "serialization_format": "cdr",
            "offered_qos_profiles": in_numbers(offered_qos(declared.topic)),
            "type_description_hash": declared.digest,
        }
        count = sum(part.counts.get(name, 0) for part in self._recorder.parts)
        return {"topic_metadata": about, "message_count": count}


def _times(parts: Sequence[Part]) -> dict[str, Any]:
    """When the messages of some files begin, how long they last, and how many there are."""
    count = sum(sum(part.counts.values()) for part in parts)
    start_ns = min(part.start_ns for part in parts) if count else 0
    return {
        "starting_time": {"nanoseconds_since_epoch": start_ns},
        "duration": {"nanoseconds": max(part.end_ns for part in parts) - start_ns},
        "message_count": count,
    }
