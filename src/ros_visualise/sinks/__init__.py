"""Where messages are recorded to: `open_recorder` finds the recorder by the target's suffix.

A target is written OUT[@TOPIC[,TOPIC...]]: ``edges.mp4``, ``edges.mp4@/edges_overlay`` or
``run.mcap@/image_raw,/edges``.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol

from ros_visualise.errors import UsageError

SUFFIXES = (".mcap", ".mp4")
PARAMETER_EVENTS = "/parameter_events"
"""The topic of a `ros_visualise.data.ParameterEvent`; a recorder that can hold it always does."""


class Recorder(Protocol):
    """An open recording; one thread at a time uses it.

    Attributes:
        path: the file.
        topics: what it records; messages of other topics are let go.
    """

    path: Path
    topics: tuple[str, ...]

    def write(self, topic: str, message: Any) -> None:
        """Record a message at the time of its header.

        Raises:
            RecordingError: it cannot go on, as on a full disk; what was written stays readable.
        """

    def close(self) -> None:
        """Finish the file; more than once does no harm.

        Raises:
            RecordingError: it could not be finished; never after `write` raised it.
        """

    def __enter__(self) -> Recorder: ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None: ...


def parse_target(target: str) -> tuple[Path, tuple[str, ...]]:
    """(File, topics) of OUT[@TOPIC[,TOPIC...]]; no topics where it names none."""
    path, _, names = target.rpartition("@")
    if not path or not names.startswith("/"):
        return Path(target), ()
    return Path(path), tuple(dict.fromkeys(name for name in names.split(",") if name))


def open_recorder(
    target: str,
    topics: Mapping[str, type],
    overwrite: bool = False,
    on_demand: Collection[str] = (),
) -> Recorder:
    """Open a recording.

    Where the target names no topics, an .mcap takes all of them and an .mp4 the last one of images,
    without those on demand.

    Args:
        target: OUT[@TOPIC[,TOPIC...]].
        topics: topic -> class of its messages, of all that there are.
        overwrite: replace a file that exists.
        on_demand: those that are only recorded when they are named.

    Raises:
        UsageError: no such topic or kind of file.
        OpenError: it exists or cannot be written.
    """
    path, named = parse_target(target)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        kinds = " or ".join(SUFFIXES)
        raise UsageError(f"{path}: a recording's name ends in {kinds}, or then in @/TOPIC")
    for name in named:
        if name not in topics:
            raise UsageError(f"{target}: no topic {name}; there are {', '.join(topics)}")
    wanted = {name: topics[name] for name in named or topics if named or name not in on_demand}
    if suffix == ".mp4":
        from ros_visualise.sinks.mp4 import Mp4Recorder, choose_topic

        return Mp4Recorder(path, choose_topic(target, wanted, bool(named)), overwrite)
    from ros_visualise.sinks.mcap import McapRecorder

    return McapRecorder(path, wanted, overwrite)
