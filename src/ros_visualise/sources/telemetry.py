"""Films of drones and cameras with the telemetry that comes with them, as one thing to play."""

from __future__ import annotations

import heapq
import logging
from collections.abc import Collection, Generator, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import OpenError, TooLarge
from ros_visualise.sources.logs.dji import fixes_beside
from ros_visualise.sources.logs.gopro import gopro_series
from ros_visualise.sources.logs.misb import misb_series
from ros_visualise.sources.recordings import Entry, Extra, Recording, TopicInfo
from ros_visualise.sources.recordings.series import SeriesRecording
from ros_visualise.sources.series import Series
from ros_visualise.sources.video import Video, VideoRecording

log = logging.getLogger(__name__)

_IMAGE = "image"


class FilmItem(NamedTuple):
    """A message, the name of the output that it is for, and its own stamp."""

    output: str
    message: Any
    stamp_ns: int = 0


class Film:
    """The images of a video, and the messages of series by the time in it."""

    def __init__(self, video: Video, series: Sequence[Series]) -> None:
        self._video, self._series = video, series

    @property
    def duration_ns(self) -> int | None:
        """Duration of the video, or of its telemetry if that is longer; None if unknown."""
        video_ns = self._video.duration_ns
        ends_ns = (int(one.stamps_ns.max()) for one in self._series if len(one.stamps_ns))
        return None if video_ns is None else max([video_ns, *ends_ns])

    def is_frame(self, item: FilmItem) -> bool:
        """True for images, which a person steps through."""
        return item.output == _IMAGE

    def read(self, start_ns: int = 0) -> Generator[tuple[int, FilmItem], None, None]:
        """(Time since the first frame, item), from the frame shown at ``start_ns`` on."""
        with closing(self._video.read(start_ns)) as frames:
            images = ((time_ns, FilmItem(_IMAGE, image)) for time_ns, image in frames)
            first = next(images, None)
            if first is None:
                return
            parts = [_measured(one, max(first[0], start_ns), first[0]) for one in self._series]
            whole = chain([first], images)  # after what was measured at the same time
            yield from heapq.merge(*parts, whole, key=lambda timed: timed[0])


class FilmRecording:
    """A film and its telemetry as a `ros_visualise.sources.recordings.Recording`."""

    def __init__(self, video: VideoRecording, telemetry: SeriesRecording) -> None:
        self._parts: tuple[Recording, ...] = (video, telemetry)
        self.image_at, self.key_image = video.image_at, video.key_image
        self.path, self.format, self.size = video.path, video.format, video.size
        self.compression = video.compression
        self.start_ns = min(video.start_ns, telemetry.start_ns)
        self.end_ns = max(video.end_ns, telemetry.end_ns)
        self.topics: Mapping[str, TopicInfo] = dict(
            sorted({**video.topics, **telemetry.topics}.items())
        )
        self.loss = video.loss
        for note in telemetry.loss.notes:
            self.loss.add(note)

    def read(
        self,
        start_ns: int | None = None,
        stop_ns: int | None = None,
        topics: Collection[str] | None = None,
    ) -> Generator[Entry, None, None]:
        """The images and measurements in order of their stamps."""
        video, telemetry = (one.read(start_ns, stop_ns, topics) for one in self._parts)
        with closing(video), closing(telemetry):
            yield from heapq.merge(video, telemetry, key=lambda entry: entry.stamp_ns)

    def stamps_ns(self) -> Mapping[str, npt.NDArray[np.int64]]:
        """The times of all, by the packets of the film."""
        return {topic: stamps for one in self._parts for topic, stamps in one.stamps_ns().items()}

    def extras(self) -> Iterator[Extra]:
        return iter(())

    def close(self) -> None:
        for one in self._parts:
            one.close()


def open_film(path: Path) -> Recording:
    """A video as a recording, with its telemetry."""
    video = VideoRecording(path)
    telemetry = recorded_telemetry(path)
    return FilmRecording(video, telemetry) if telemetry.topics or telemetry.loss else video


def recorded_telemetry(path: Path) -> SeriesRecording:
    """The telemetry of a film as a recording: no topics in a film without any."""
    faults: list[str] = []
    series = [replace(one, topic=_topic(one.topic)) for one in telemetry_of(path, faults)]
    recorded = SeriesRecording(path, "telemetry", 0, series)
    for fault in faults:
        recorded.loss.add(fault)
    return recorded


def telemetry_of(film: str | Path, faults: list[str] | None = None) -> list[Series]:
    """The series of a film, such as ``fix`` and ``imu``; stamps count from its start.

    GoPro's telemetry and MISB's are tracks of the film, DJI's are subtitles in a file beside it. Of
    a film that cannot be opened nothing is returned: the error is reported where it is played.

    Args:
        film: the file.
        faults: gets a note on damaged telemetry.
    """
    path = Path(film)
    try:
        notes = [] if faults is None else faults
        return [*gopro_series(path, notes)] or misb_series(path, notes) or fixes_beside(path)
    except TooLarge as error:
        log.warning("%s: played without its telemetry: %s", path, error)
    except OpenError:
        pass
    return []


def _topic(name: str) -> str:
    return "/imu/data" if name == "imu" else f"/{name}"


def _measured(series: Series, start_ns: int, shown_ns: int) -> Iterator[tuple[int, FilmItem]]:
    """(Time, item) from a time on; the last one until then comes with the image that is shown."""
    order = np.argsort(series.stamps_ns, kind="stable")
    begin = int(np.searchsorted(series.stamps_ns[order], start_ns, "right"))
    for index in order[max(begin - 1, 0) :]:
        own_ns = int(series.stamps_ns[index])
        time_ns = own_ns if own_ns > start_ns else shown_ns
        yield time_ns, FilmItem(series.topic, series.make(int(index)), own_ns)
