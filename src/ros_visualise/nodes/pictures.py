"""The node that plays pictures: a file, or all of a folder."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ros_visualise.core.errors import OpenError
from ros_visualise.core.params import param
from ros_visualise.data import Header, Image
from ros_visualise.messages.restamped import restamped
from ros_visualise.nodes import Source, SourceType, find_source, source
from ros_visualise.sources.calibration import Calibration
from ros_visualise.sources.logs.stills import NS_PER_PICTURE, still_series
from ros_visualise.sources.pictures import Pictures, picture_files
from ros_visualise.sources.playback import Playback
from ros_visualise.sources.series import Series


@dataclass(frozen=True)
class PicturesParams:
    """Parameters of `PicturesNode`."""

    path: str = param(
        "", "a picture, or a folder of pictures", restart=True, saved=False, file=bool
    )
    fps: float = param(
        1.0, "rate of pictures, Hz", min=0.01, max=240, slider=(0.1, 30), restart=True
    )
    frame_id: str = param("camera_optical", "frame_id of the images", restart=True)
    camera_info_url: str = param(
        "",
        "camera calibration, a ROS YAML file: a path or file:///PATH",
        restart=True,
        saved=False,
        file=bool,
    )


@source("pictures", params=PicturesParams, outputs={"image": Image})
class PicturesNode:
    """Play a picture, or all pictures in a folder, sorted by name."""

    def __init__(
        self, params: PicturesParams, playback: Playback, series: Sequence[Series] = ()
    ) -> None:
        if not params.path:
            raise OpenError("pictures: give a picture or a folder of them, its parameter path")
        self._params, self._playback, self._series = params, playback, series
        self._calibration = Calibration(params.camera_info_url)
        self._pictures = Pictures(params.path, params.fps)
        playback.check_start(self._pictures.duration_ns)

    def messages(self) -> Iterator[tuple[str, Any]]:
        """The pictures, each when its time has come, after what they say of their camera."""
        for stamp_ns, image in self._playback.run(self._pictures):
            number = round(image.header.stamp_ns * self._params.fps / 1e9)
            yield from self._said(number * NS_PER_PICTURE, stamp_ns)
            stamped = replace(image, header=Header(stamp_ns, self._params.frame_id))
            yield "image", self._calibration.add_to(stamped)

    def _said(self, own_ns: int, stamp_ns: int) -> Iterator[tuple[str, Any]]:
        """The messages of one picture, and the first of those that hold for all."""
        for one in self._series:
            for index in np.flatnonzero((one.stamps_ns == own_ns) | (len(one.stamps_ns) == 1)):
                message = one.make(int(index))
                yield one.topic, restamped(message, stamp_ns - message.header.stamp_ns)

    def report(self) -> dict[str, Any]:
        """Notes on unreadable files."""
        notes = self._pictures.faults
        return {"lost": {"messages": len(notes), "bytes": 0, "notes": notes}} if notes else {}

    def close(self) -> None:
        """Nothing is open."""


def pictures(path: str | Path) -> SourceType:
    """A source that plays pictures, with an output for each kind of data in them."""
    declared = find_source("pictures")
    series = still_series(picture_files(Path(path)))
    make: Callable[..., Source] = declared.make
    return replace(
        declared,
        make=partial(make, series=series),
        outputs={**declared.outputs, **{one.topic: one.kind for one in series}},
        latched=frozenset(one.topic for one in series if one.latched),
    )
