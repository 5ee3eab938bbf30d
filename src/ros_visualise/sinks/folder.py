"""Recording to a folder as rosbag2 writes it: one .mcap, and metadata.yaml beside it."""

from __future__ import annotations

from collections.abc import Mapping
from io import StringIO
from pathlib import Path
from typing import Any

from rosbags.convert.converter import LATCH
from rosbags.rosbag2.metadata import dump_qos_v8
from ruamel.yaml import YAML

from ros_visualise.errors import OpenError
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks import Settings
from ros_visualise.sinks.files import already_there, no_folder, recording_failed
from ros_visualise.sinks.mcap import McapRecorder

_METADATA = "metadata.yaml"
_VERSION = 8  # what ROS 2 Iron writes, and later ones read


class FolderRecorder:
    """Any number of topics in a ROS 2 bag with MCAP storage.

    Its metadata.yaml is written at the end; one that was killed before is found by its .mcap.

    Raises:
        OpenError: the folder is there and not to be replaced, or holds something else than a bag.
    """

    def __init__(self, path: Path, topics: Mapping[str, TopicType], settings: Settings) -> None:
        self.path = path
        _make_folder(path, settings.overwrite)
        self._recorder = McapRecorder(path / f"{path.name}_0.mcap", topics, settings)
        self._closed = False

    @property
    def topics(self) -> tuple[str, ...]:
        """As `ros_visualise.sinks.Recorder`."""
        return self._recorder.topics

    def add(self, topic: str, kind: TopicType) -> None:
        """As `ros_visualise.sinks.Recorder`."""
        self._recorder.add(topic, kind)

    def write(self, topic: str, message: Any, stamp_ns: int | None = None) -> None:
        """As `ros_visualise.sinks.Recorder`."""
        self._recorder.write(topic, message, stamp_ns)

    def close(self) -> None:
        """Finish the file and describe it; more than once does no harm."""
        if self._closed:
            return
        self._closed = True
        self._recorder.close()
        text = StringIO()
        yaml = YAML(typ="safe", pure=True)
        yaml.default_flow_style = False
        yaml.width = 4096
        yaml.dump(self._describe(), text)
        try:
            (self.path / _METADATA).write_text(text.getvalue())
        except OSError as error:
            kept = sum(self._recorder.counts.values())
            raise recording_failed(self.path, error, kept) from None

    def __enter__(self) -> FolderRecorder:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _describe(self) -> dict[str, Any]:
        found = self._recorder
        count = sum(found.counts.values())
        start_ns = found.start_ns if count else 0

        def times() -> dict[str, Any]:
            return {
                "starting_time": {"nanoseconds_since_epoch": start_ns},
                "duration": {"nanoseconds": found.end_ns - start_ns},
                "message_count": count,
            }

        about = {
            "version": _VERSION,
            "storage_identifier": "mcap",
            "relative_file_paths": [found.path.name],
            **times(),
            "topics_with_message_count": [self._describe_topic(name) for name in self.topics],
            "compression_format": "",
            "compression_mode": "",
            "files": [{"path": found.path.name, **times()}],
            "custom_data": None,
            "ros_distro": "ros_visualise",
        }
        return {"rosbag2_bagfile_information": about}

    def _describe_topic(self, name: str) -> dict[str, Any]:
        declared = self._recorder.declared[name]
        about = {
            "name": name,
            "type": declared.name,
            "serialization_format": "cdr",
            "offered_qos_profiles": dump_qos_v8(LATCH) if declared.latched else "",
            "type_description_hash": declared.digest,
        }
        return {"topic_metadata": about, "message_count": self._recorder.counts[name]}


def _make_folder(path: Path, overwrite: bool) -> None:
    if path.exists() and not overwrite:
        raise already_there(path)
    if path.exists() and not path.is_dir():
        raise OpenError(f"{path}: is a file; choose another name for a ROS 2 bag's folder")
    try:
        path.mkdir(exist_ok=True)
        there = list(path.iterdir())
        if any(one.name != _METADATA and one.suffix not in (".mcap", ".db3") for one in there):
            raise OpenError(f"{path}: holds more than a ROS 2 bag; choose another name")
        for one in there:
            one.unlink()
    except FileNotFoundError:
        raise no_folder(path) from None
    except OSError as error:
        raise OpenError(f"{path}: cannot be written: {error.strerror}") from None
