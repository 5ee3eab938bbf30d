"""The node that plays a recording: a bag, an MCAP file, a KITTI folder, a flight log."""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, make_dataclass, replace
from functools import partial
from types import MappingProxyType
from typing import Any

from ros_visualise.core.errors import DamagedMessage, UsageError, did_you_mean
from ros_visualise.data import Detections, Image
from ros_visualise.messages.recorded import TopicType, content
from ros_visualise.nodes import NoParams, Source, SourceType, find_source, param, source
from ros_visualise.sources.calibration import Calibration
from ros_visualise.sources.opening import open_again
from ros_visualise.sources.playback import Playback
from ros_visualise.sources.recordings import Entry, KeyImage, Recording
from ros_visualise.sources.recordings.joined import MAX_OFFSET_S, JoinedRecording
from ros_visualise.sources.recordings.playing import PlayableRecording, PlayedTime

log = logging.getLogger(__name__)

_LISTED = 3  # of topics that share a reason, and of reasons, so many are named
_LONG_HOURS = 72  # from here on a gap is printed in days


@source("player", params=NoParams, outputs={}, makes_time=True)
class Player:
    """Play a recording, with an output for each topic."""

    def __init__(
        self,
        recording: Recording,
        topics: Collection[str],
        unplayed: Mapping[str, str],
        calibrations: Mapping[str, str],
        params: Any,
        playback: Playback,
    ) -> None:
        self._recording, self._unplayed = recording, unplayed
        self._playback = playback
        self._calibrations = {topic: Calibration(url) for topic, url in calibrations.items()}
        playback.step_topics = tuple(topics)
        self._moved: Any = None
        self._playable = self._placed(params)
        self._report_gaps(self._playable.time.gaps_ns)
        playback.check_start(self._playable.duration_ns)

    def messages(self) -> Iterator[tuple[str, Any]]:
        """The recorded messages, each when its time has come."""
        while True:
            for _, batch in self._playback.run(self._playable, self._playable.is_frame):
                for entry in batch:
                    yield entry.topic, self._calibrated(entry)
            if self._moved is None or not self._playback.take_restart():
                return
            params, self._moved = self._moved, None
            shown_ns = self._playable.time.stamp_ns(self._playback.time_ns())
            self._playable = self._placed(params)
            self._playback.seek(self._playable.time.place_ns(shown_ns) / 1e9)

    def configure(self, params: Any, changed: Collection[str]) -> None:
        """Move sources that are played together; what is shown stays as it can."""
        recording = self._recording
        if isinstance(recording, JoinedRecording) and not set(recording.names).isdisjoint(changed):
            self._moved = params
            self._playback.restart()

    def report(self) -> dict[str, Any]:
        """Losses, and topics that cannot be played with the reasons."""
        loss = self._recording.loss
        lost = {"lost": asdict(loss)} if loss else {}
        return {**lost, "unplayed": dict(self._unplayed)} if self._unplayed else lost

    def close(self) -> None:
        """End reading."""
        self._recording.close()

    def _placed(self, params: Any) -> PlayableRecording:
        """The recording on its line of time, each source with its offset."""
        recording = self._recording
        if isinstance(recording, JoinedRecording):
            recording.move([getattr(params, name) for name in recording.names])
        topics, playback = self._playback.step_topics, self._playback
        playable = PlayableRecording(recording, topics, lambda: playback.step_topic)
        playback.recorded = playable.time
        if isinstance(recording, JoinedRecording):
            playback.sources = recording.sources(playable.time)
            kinds = {topic: recording.topics[topic].type.data_class for topic in topics}
            images = [topic for topic, kind in kinds.items() if kind is Image]
            find = recording.key_image(images[0]) if len(images) == 1 else None
            playback.key_image = find and partial(_key_image, find, playable.time)
        return playable

    def _calibrated(self, entry: Entry) -> Any:
        """The recorded message; images with their calibration, if one is given."""
        kind = self._recording.topics[entry.topic].type.data_class
        given = self._calibrations.get(entry.topic)
        if given is None or kind not in (Image, Detections):
            return entry.message
        try:
            return given.add_to(content(entry.message))
        except DamagedMessage:
            return entry.message  # its decoder reports it

    def _report_gaps(self, gaps_ns: Sequence[int]) -> None:
        if not gaps_ns:
            return
        lengths = _listed([_length(gap_ns) for gap_ns in gaps_ns])
        is_one = len(gaps_ns) == 1
        log.warning(
            "%s: skipping %s without messages; the stamps jump accordingly",
            self._recording.path,
            f"a gap of {lengths}" if is_one else f"{len(gaps_ns)} gaps ({lengths})",
        )


def _key_image(find: KeyImage, time: PlayedTime, place_ns: int) -> tuple[int, Any] | None:
    """The key image before a place, with its own place."""
    found = find(time.stamp_ns(place_ns))
    return None if found is None else (time.place_ns(found[0]), found[1])


def player(
    recording: Recording,
    topics: Collection[str] = (),
    without: Collection[str] = (),
    calibrations: Mapping[str, str] = MappingProxyType({}),
) -> SourceType:
    """A source that plays this recording, with an output for each topic, of the same name.

    Unless topics are given, those that cannot be played are logged.

    Args:
        recording: it is open; the first source that is made closes it, later ones open it again.
        topics: these alone; none: all that can be read.
        without: all but these.
        calibrations: topic -> file with the calibration of its images or detections, in place of
            the recorded one.

    Raises:
        UsageError: a topic is missing or unreadable, or all are.
    """
    played = _played(recording, topics, without)
    unplayed = {} if topics else _unplayed(recording, without)
    if unplayed:
        log.warning("%s: not played: %s", recording.path, _listed_by_reason(unplayed))
    types = {name: recording.topics[name].type for name in played}
    declared = find_source("player")
    make: Callable[..., Source] = declared.make
    opened = [recording]

    def begin(params: Any, playback: Playback) -> Source:
        taken = opened.pop() if opened else _open_again(recording, params)
        return make(taken, played, unplayed, calibrations, params, playback)

    return replace(
        declared,
        make=begin,
        params=_offsets_of(recording) if isinstance(recording, JoinedRecording) else NoParams,
        outputs={name: type.data_class for name, type in types.items()},
        latched=frozenset(name for name, type in types.items() if type.qos.transient_local),
        ros=types,
        recording=partial(_open_again, recording),
        shown=_first_images(recording, types) if isinstance(recording, JoinedRecording) else (),
    )


def _open_again(recording: Recording, params: Any) -> Recording:
    opened = open_again(recording)
    if isinstance(opened, JoinedRecording):
        opened.move([getattr(params, name) for name in opened.names])
    return opened


def _first_images(recording: JoinedRecording, types: Mapping[str, TopicType]) -> list[str]:
    """The first topic of images of each source that has any."""
    found = (
        [t for t in part if t in types and types[t].data_class is Image] for part in recording.parts
    )
    return [images[0] for images in found if images]


def _offsets_of(recording: JoinedRecording) -> type:
    """A parameter for the offset of each source."""
    fields = [
        (
            name,
            float,
            param(
                0.0,
                f"offset of {path.name}, seconds; positive is later",
                min=-MAX_OFFSET_S,
                max=MAX_OFFSET_S,
                slider=(-10, 10),
                step=0.01,
                group="offset",
                label=name,
            ),
        )
        for name, path in zip(recording.names, recording.paths, strict=True)
    ]
    return make_dataclass("OffsetParams", fields, frozen=True)


def _played(
    recording: Recording, wanted: Collection[str], without: Collection[str]
) -> Collection[str]:
    topics = recording.topics
    for name in wanted:
        if name not in topics:
            raise UsageError(f"no topic {name}{did_you_mean(name, topics)}")
        if topics[name].unreadable:
            raise UsageError(f"{name} cannot be played: {topics[name].unreadable}")
    readable = [name for name, topic in topics.items() if not topic.unreadable]
    found = wanted or [name for name in readable if name not in without]
    if not found:
        unplayed = _unplayed(recording, without)
        why = f": {_listed_by_reason(unplayed)}" if unplayed else ""
        raise UsageError(f"{recording.path}: nothing in it can be played{why}")
    return found


def _unplayed(recording: Recording, without: Collection[str]) -> dict[str, str]:
    """Topics with messages that cannot be played -> the reason."""
    return {
        name: topic.unreadable
        for name, topic in recording.topics.items()
        if topic.unreadable and topic.messages and name not in without
    }


def _listed_by_reason(unplayed: Mapping[str, str]) -> str:
    by_reason: dict[str, list[str]] = {}
    for name, why in unplayed.items():
        by_reason.setdefault(why, []).append(name)
    return _listed([f"{_listed(names)} ({why})" for why, names in by_reason.items()], "; ")


def _listed(items: Sequence[str], separator: str = ", ") -> str:
    more = f" and {len(items) - _LISTED} more" if len(items) > _LISTED else ""
    return separator.join(items[:_LISTED]) + more


def _length(time_ns: int) -> str:
    hours = time_ns / 3.6e12
    return f"{hours:.1f} hours" if hours < _LONG_HOURS else f"{hours / 24:.0f} days"
