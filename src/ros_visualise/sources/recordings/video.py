"""A video file as a recording of one topic."""

from __future__ import annotations

import os
from collections.abc import Collection, Generator, Iterator, Mapping
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Header
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sources.recordings import Entry, Extra, Loss, TopicInfo
from ros_visualise.sources.video import Video

_TOPIC = "/image_raw"
_FRAME = "camera_optical"


class VideoRecording:
    """As `ros_visualise.sources.recordings.Recording`; times begin with 0.

    Raises:
        OpenError: as `Video`.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._video = Video(path)
        self.path = Path(path)
        self.format = self._video.format
        self.size = self.path.stat().st_size
        self.compression = self._video.info.codec
        self.loss = Loss()
        self.start_ns, self.end_ns = 0, self._video.duration_ns or 0
        kind = TopicType("sensor_msgs/msg/Image")
        self.topics: Mapping[str, TopicInfo] = {
            _TOPIC: TopicInfo(kind, self._video.info.frames or 0)
        }

    def read(
        self,
        start_ns: int | None = None,
        stop_ns: int | None = None,
        topics: Collection[str] | None = None,
    ) -> Generator[Entry, None, None]:
        """The images in their order."""
        if topics is not None and _TOPIC not in topics:
            return
        with closing(self._video.read(start_ns or 0)) as images:
            for stamp_ns, image in images:
                if stop_ns is not None and stamp_ns >= stop_ns:
                    return
                if start_ns is None or stamp_ns >= start_ns:
                    header = Header(stamp_ns, _FRAME)
                    yield Entry(_TOPIC, stamp_ns, replace(image, header=header))
        self.loss.notes[:] = self._video.faults

    def stamps_ns(self) -> Mapping[str, npt.NDArray[np.int64]]:
        """The times of the images, from decoding them."""
        return {_TOPIC: np.array([entry.stamp_ns for entry in self.read()], np.int64)}

    def extras(self) -> Iterator[Extra]:
        return iter(())

    def close(self) -> None:
        """End what is being read."""
        self._video.close()
