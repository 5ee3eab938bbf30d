"""Where messages are recorded to: `open_recorder` finds the recorder by the name's suffix."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal, Protocol

from ros_visualise.core.errors import UsageError, did_you_mean
from ros_visualise.data import ParameterEvent
from ros_visualise.messages import type_name
from ros_visualise.messages.definitions import Encoding
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sources.recordings import Extra

if TYPE_CHECKING:
    from ros_visualise.sinks.chunked import ChunkedRecorder
    from ros_visualise.sinks.parts import Split

Kind = Literal["mcap", "bag", "mp4", "folder"]
Profile = Literal["ros1", "ros2"]

COMPRESSIONS: dict[Kind, tuple[str, ...]] = {
    "mcap": ("auto", "lz4", "none", "zstd"),
    "folder": ("auto", "lz4", "none", "zstd"),
    "bag": ("none", "lz4", "bz2"),
    "mp4": (),
}
"""Kind of recording -> how it may be compressed; the first one is what it is if nobody says.

``auto``: small messages by ZSTD, large ones, as images, by LZ4.
"""
PARAMETER_EVENTS = "/parameter_events"
"""The topic of a `ros_visualise.data.ParameterEvent`; with ROS 2 types it is always recorded."""


@dataclass(frozen=True)
class Settings:
    """How a recording is written; as `open_recorder` has them."""

    encoding: Encoding
    compression: str
    overwrite: bool
    live: bool
    split: Split | None = None


class Recorder(Protocol):
    """An open recording; one thread at a time uses it.

    Attributes:
        haste: write as fast as can be, without compression.
    """

    haste: bool

    @property
    def files(self) -> int:
        """How many files there are by now, of one that is split; else 1."""

    @property
    def path(self) -> Path:
        """The file or folder; until it is whole, one that replaces another is beside that."""

    @property
    def unplaced(self) -> Mapping[str, int]:
        """What it was given and has no place for: ``attachment`` -> how many of them."""

    @property
    def topics(self) -> tuple[str, ...]:
        """What it records; messages of other topics are let go."""

    def add(self, topic: str, kind: TopicType) -> None:
        """Record one more topic from now on; a video lets it go.

        Raises:
            RecordingError: as `write`.
        """

    def add_extra(self, extra: Extra) -> None:
        """Keep what belongs to no topic, if it has a place for that; else it is `unplaced`.

        Raises:
            RecordingError: as `write`.
        """

    def write(self, topic: str, message: Any, stamp_ns: int | None = None) -> None:
        """Record a message.

        Args:
            topic: one of `topics`.
            message: one of `ros_visualise.data` or a
                `ros_visualise.messages.recorded.Recorded`.
            stamp_ns: its time; else that at which it was recorded before, or that of its header.

        Raises:
            DamagedMessage: this one cannot be written; others can.
            RecordingError: it cannot go on, as on a full disk; what was written stays readable.
        """

    def close(self, whole: bool = True) -> None:
        """Finish the file; more than once does no harm.

        Args:
            whole: it has all that it should have, and replaces what is to be replaced.

        Raises:
            RecordingError: it could not be finished; never after `write` raised it.
        """

    def remove(self) -> None:
        """Delete what was written, after `close`; what was to be replaced stays."""

    def __enter__(self) -> Recorder: ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None: ...


def kind_of(path: Path) -> Kind:
    """What kind of recording a name stands for; one without a suffix is a ROS 2 folder.

    Raises:
        UsageError: it ends in something else.
    """
    kinds: dict[str, Kind] = {"": "folder", ".mcap": "mcap", ".bag": "bag", ".mp4": "mp4"}
    kind = kinds.get(path.suffix.lower())
    if kind is None:
        raise UsageError(
            f"{path}: a recording's name ends in .mcap, .bag or .mp4, or then in @/TOPIC; without"
            " any of these it is the folder of a ROS 2 bag"
            + did_you_mean(path.suffix, filter(None, kinds), listed=False)
        )
    return kind


def encoding_of(path: Path, profile: Profile | None = None) -> Encoding:
    """How messages stand in a recording.

    Raises:
        UsageError: this kind of file does not hold messages of that profile.
    """
    kind = kind_of(path)
    if (kind, profile) in (("bag", "ros2"), ("folder", "ros1")):
        other = "ROS 1 (--profile ros1)" if kind == "bag" else "ROS 2 (--profile ros2)"
        raise UsageError(f"{path}: holds messages of {other} alone; record to .mcap instead")
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

    Where no topics are named, it takes all of them, and an .mp4 the last one of images, without
    those on demand.

    Args:
        path: the new file or folder.
        topics: topic -> type of its messages, of all that there are.
        overwrite: replace a file that exists.
        on_demand: those that are only recorded when they are named.
        named: the topics to record.
        beside: topic -> the one that is recorded with it, if there is such a one.
        profile: an .mcap may hold messages of ROS 1; if nobody says, they are of ROS 2.
        compression: one of `COMPRESSIONS`.
        live: messages come as they are made: a process that is killed loses none, and changes of
            parameters are recorded too. Otherwise they are gathered in larger chunks.
        split: when another file begins, beside the first one or in the same folder; not of videos.

    Raises:
        DamagedMessage: a type that cannot be written so.
        UsageError: no such topic, compression or kind of file.
        OpenError: it exists or cannot be written.
    """
    path = Path(path)
    kind, encoding = kind_of(path), encoding_of(path, profile)
    compression = _choose_compression(path, kind, compression)
    wanted = _choose_topics(path, named, topics, on_demand)
    if kind == "mp4":
        if split is not None:
            raise UsageError(f"{path}: a video is not split; record to .mcap, .bag or a folder")
        from ros_visualise.sinks.mp4 import Mp4Recorder, choose_topic

        return Mp4Recorder(path, choose_topic(path, wanted, bool(named)), overwrite)
    also = [name for topic, name in (beside or {}).items() if topic in wanted]
    wanted |= {name: topics[name] for name in also if name in topics}
    if live and encoding == "cdr":
        wanted[PARAMETER_EVENTS] = TopicType(type_name(ParameterEvent))
    return _open_chunked(
        path, kind, wanted, Settings(encoding, compression, overwrite, live, split)
    )


def _open_chunked(
    path: Path, kind: Kind, wanted: Mapping[str, TopicType], settings: Settings
) -> Recorder:
    if kind == "folder":
        from ros_visualise.sinks.folder import FolderRecorder

        return FolderRecorder(path, wanted, settings)
    if settings.split is None:
        return _open_file(path, wanted, settings)
    from ros_visualise.sinks.parts import SplitRecorder

    open_file = partial(_open_file, settings=settings)
    return SplitRecorder(path, open_file, wanted, settings.split, settings.overwrite)


def _open_file(path: Path, wanted: Mapping[str, TopicType], settings: Settings) -> ChunkedRecorder:
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
        can = ", ".join(possible) or "nothing but what it is"
        raise UsageError(f"{path}: cannot be compressed by {wanted}; it can by {can}")
    return wanted


def _choose_topics(
    path: Path,
    named: Collection[str],
    topics: Mapping[str, TopicType],
    on_demand: Collection[str],
) -> dict[str, TopicType]:
    """Those that are named, else all but those on demand."""
    for name in named:
        if name not in topics:
            raise UsageError(f"{path}: no topic {name}; there are {', '.join(topics)}")
    wanted = named or [name for name in topics if name not in on_demand]
    return {name: topics[name] for name in wanted}
