"""Recorders of messages; `open_recorder` chooses one by the suffix of the name."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from ros_visualise.core.errors import UsageError, did_you_mean
from ros_visualise.data import ParameterEvent
from ros_visualise.messages.definitions import Encoding
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sources.recordings import Extra

if TYPE_CHECKING:
    from ros_visualise.sinks.chunked import ChunkedRecorder
    from ros_visualise.sinks.parts import Split

Kind = Literal["mcap", "bag", "mp4", "csv", "txt", "tlog", "folder"]
Profile = Literal["ros1", "ros2"]

COMPRESSIONS: dict[Kind, tuple[str, ...]] = {
    "mcap": ("auto", "lz4", "none", "zstd"),
    "folder": ("auto", "lz4", "none", "zstd"),
    "bag": ("none", "lz4", "bz2"),
    "mp4": (),
    "csv": (),
    "txt": (),
    "tlog": (),
}
"""Kind of recording -> its compressions, the default first.

``auto``: small messages by ZSTD, large ones, such as images, by LZ4.
"""
PARAMETER_EVENTS = "/parameter_events"
"""The topic of a `ros_visualise.data.ParameterEvent`; with ROS 2 types it is always recorded."""


@dataclass(frozen=True)
class SinkSettings:
    """SinkSettings of a recording; see `open_recorder`."""

    encoding: Encoding
    compression: str
    overwrite: bool
    live: bool
    split: Split | None = None


R = TypeVar("R", bound="Recorder")


class Recorder(ABC):
    """An open recording; one thread at a time uses it.

    Attributes:
        unthrottled: write as fast as possible, without compression.
    """

    unthrottled = False

    @property
    def files(self) -> int:
        """Number of files so far."""
        return 1

    @property
    @abstractmethod
    def path(self) -> Path:
        """The file or folder; while it replaces another one, a place beside that."""

    @property
    @abstractmethod
    def topics(self) -> tuple[str, ...]:
        """The recorded topics; messages of other topics are ignored."""

    @property
    def unplaced(self) -> Mapping[str, int]:
        """Things that this format cannot store: ``attachment`` -> their number."""
        return {}

    def add(self, topic: str, kind: TopicType) -> None:  # noqa: B027
        """Record one more topic from now on; a video ignores it.

        Raises:
            RecordingError: as `write`.
        """

    def add_extra(self, extra: Extra) -> None:  # noqa: B027
        """Store an attachment or metadata; a video ignores it.

        Raises:
            RecordingError: as `write`.
        """

    @abstractmethod
    def write(self, topic: str, message: Any, stamp_ns: int | None = None) -> None:
        """Record a message.

        Args:
            topic: one of `topics`.
            message: one of `ros_visualise.data` or a
                `ros_visualise.messages.recorded.Recorded`.
            stamp_ns: its time; by default its earlier time of recording, or its header's stamp.

        Raises:
            DamagedMessage: this one cannot be written; others can.
            RecordingError: the recording ends, as on a full disk; earlier messages stay readable.
        """

    @abstractmethod
    def close(self, whole: bool = True) -> None:
        """Finish the file; more than once does no harm.

        Args:
            whole: the recording is complete, and replaces an old one.

        Raises:
            RecordingError: it could not be finished; never after `write` raised it.
        """

    @abstractmethod
    def remove(self) -> None:
        """Delete the new files, after `close`; an old recording stays."""

    def __enter__(self: R) -> R:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self.close(whole=kind is None)


def kind_of(path: Path) -> Kind:
    """The kind of recording by its name; one without a suffix is a ROS 2 folder.

    Raises:
        UsageError: unknown suffix.
    """
    kinds: dict[str, Kind] = {f".{kind}": kind for kind in COMPRESSIONS if kind != "folder"}
    kind = {"": "folder", **kinds}.get(path.suffix.lower())
    if kind is None:
        raise UsageError(
            f"{path}: the name of a recording must end in .mcap, .bag, .mp4, .csv, .txt (tracks) or"
            " .tlog (MAVLink), optionally followed by @/TOPIC; a name without a suffix makes a"
            " ROS 2 bag folder" + did_you_mean(path.suffix, filter(None, kinds), listed=False)
        )
    return kind


def encoding_of(path: Path, profile: Profile | None = None) -> Encoding:
    """The encoding of messages in a recording.

    Raises:
        UsageError: this kind of file cannot store messages of that profile.
    """
    kind = kind_of(path)
    if (kind, profile) in (("bag", "ros2"), ("folder", "ros1")):
        other = "ROS 1 (profile ros1)" if kind == "bag" else "ROS 2 (profile ros2)"
        raise UsageError(f"{path}: can only store messages of {other}; record to .mcap instead")
    return "ros1" if kind == "bag" or profile == "ros1" else "cdr"


def open_recorder(
    path: str | Path,
    topics: Mapping[str, TopicType],
    overwrite: bool = False,
    on_demand: Collection[str] = (),
    *,
    named: Collection[str] = (),
    beside: Mapping[str, str] | None = None,
    profile: Profile | None = None,
    compression: str | None = None,
    live: bool = True,
    split: Split | None = None,
) -> Recorder:
    """Open a recording.

    Args:
        path: the new file or folder.
        topics: all topics -> type of their messages.
        overwrite: replace an existing recording.
        on_demand: topics that are only recorded if named.
        named: the topics to record; by default all, for an .mp4 the last one of images, for a .csv
            those with numbers, for a .txt the last one of detections, for a .tlog those of
            MAVLink, without those on demand.
        beside: topic -> another one that is recorded with it, if it exists.
        profile: an .mcap may store messages of ROS 1; the default is ROS 2.
        compression: one of `COMPRESSIONS`.
        live: a killed process loses no message, and changes of parameters are recorded too.
            Otherwise messages are collected in larger chunks.
        split: when to begin another file, beside the first one or in the same folder; not for
            videos.

    Raises:
        DamagedMessage: a type that cannot be written so.
        UsageError: unknown topic, compression or kind of file.
        OpenError: it exists or cannot be written.
    """
    path = Path(path)
    kind, encoding = kind_of(path), encoding_of(path, profile)
    compression = _choose_compression(path, kind, compression)
    wanted = _choose_topics(path, named, topics, on_demand)
    if kind in ("mp4", "csv", "txt", "tlog"):
        if split is not None:
            raise UsageError(
                f"{path}: .{kind} files cannot be split; record to .mcap, .bag or a folder"
            )
        return _open_extract(path, kind, wanted, bool(named), overwrite, live)
    also = [name for topic, name in (beside or {}).items() if topic in wanted]
    wanted |= {name: topics[name] for name in also if name in topics}
    if live and encoding == "cdr":
        wanted[PARAMETER_EVENTS] = TopicType(ParameterEvent.type_name)
    return _open_chunked(
        path, kind, wanted, SinkSettings(encoding, compression, overwrite, live, split)
    )


def _open_extract(
    path: Path,
    kind: Kind,
    wanted: Mapping[str, TopicType],
    named: bool,
    overwrite: bool,
    live: bool,
) -> Recorder:
    """A file with a part of the messages: images or tracks of a topic, numbers, or MAVLink."""
    if kind == "csv":
        from ros_visualise.sinks.csv_file import CsvRecorder, topics_with_numbers

        chosen = [*wanted] if named else topics_with_numbers(path, wanted)
        return CsvRecorder(path, chosen, overwrite, live)
    if kind == "txt":
        from ros_visualise.sinks import mot_file

        topic = mot_file.choose_topic(path, wanted, named)
        return mot_file.MotRecorder(path, topic, overwrite, live)
    if kind == "tlog":
        from ros_visualise.sinks.tlog import TlogRecorder, mavlink_topics

        return TlogRecorder(path, mavlink_topics(path, wanted), overwrite, live=True)
    from ros_visualise.sinks.mp4 import Mp4Recorder, choose_topic

    return Mp4Recorder(path, choose_topic(path, wanted, named), overwrite)


def _open_chunked(
    path: Path, kind: Kind, wanted: Mapping[str, TopicType], settings: SinkSettings
) -> Recorder:
    if kind == "folder":
        from ros_visualise.sinks.folder import FolderRecorder

        return FolderRecorder(path, wanted, settings)
    if settings.split is None:
        return _open_file(path, wanted, settings)
    from ros_visualise.sinks.parts import SplitRecorder

    open_file = partial(_open_file, settings=settings)
    return SplitRecorder(path, open_file, wanted, settings.split, settings.overwrite)


def _open_file(
    path: Path, wanted: Mapping[str, TopicType], settings: SinkSettings
) -> ChunkedRecorder:
    if path.suffix.lower() == ".bag":
        from ros_visualise.sinks.bag import BagRecorder

        return BagRecorder(path, wanted, settings)
    from ros_visualise.sinks.mcap_file import McapRecorder

    return McapRecorder(path, wanted, settings)


def _choose_compression(path: Path, kind: Kind, wanted: str | None) -> str:
    possible = COMPRESSIONS[kind]
    if wanted is None:
        return next(iter(possible), "")
    if wanted not in possible:
        supported = f"supported: {', '.join(possible)}" if possible else "no compression"
        raise UsageError(f"{path}: unsupported compression {wanted}; {supported}")
    return wanted


def _choose_topics(
    path: Path,
    named: Collection[str],
    topics: Mapping[str, TopicType],
    on_demand: Collection[str],
) -> dict[str, TopicType]:
    for name in named:
        if name not in topics:
            raise UsageError(f"{path}: no topic {name}; choose from {', '.join(topics)}")
    wanted = named or [name for name in topics if name not in on_demand]
    return {name: topics[name] for name in wanted}
