"""Poses and lenses of aircraft's cameras in films with MISB's metadata: MPEG-TS with KLV.

Topics, beside those of `ros_visualise.sources.camera_poses`: ``misb/uas_datalink`` with all values.
Altitudes are above the sea; the ground's is that of the frame's centre.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
from av.error import FFmpegError

from ros_visualise.core.limits import object_limit
from ros_visualise.core.printing import counted
from ros_visualise.data import CameraInfo, Floats
from ros_visualise.geometry import rotations
from ros_visualise.sources.camera_poses import (
    CameraPoses,
    camera_series,
    lens_series,
    optical_quats,
)
from ros_visualise.sources.demux import open_container, video_stream
from ros_visualise.sources.logs.klv import KlvStream, KlvValue
from ros_visualise.sources.logs.logged import LogFields, logged_series
from ros_visualise.sources.logs.tables import LogTable
from ros_visualise.sources.series import Series
from ros_visualise.vision.lens_table import lens_of_angle
from ros_visualise.vision.reshape import Size

_FORMAT = "mpegts"
_TABLE, _TIME = "uas_datalink", "timestamp"
_HELD_NS = 1_000_000_000  # a value that is not in each set
_ZOOM = 0.01  # change of the field of view that is a new lens
_BODY = ("platform_heading", "platform_pitch", "platform_roll")
_SENSOR = ("sensor_relative_azimuth", "sensor_relative_elevation", "sensor_relative_roll")
_ALTITUDES = (
    ("sensor_altitude", "frame_center_elevation"),
    ("sensor_ellipsoid_height_extended", "frame_center_ellipsoid_height"),
    ("sensor_ellipsoid_height", "frame_center_ellipsoid_height"),
)
"""Altitudes of the camera and of the ground above the same level, the preferred ones first."""

_Times = npt.NDArray[np.int64]
_Set = Mapping[str, KlvValue]


def misb_series(path: Path, faults: list[str]) -> list[Series]:
    """The series of a film, by its time; ``faults`` gets a note on damage.

    Raises:
        OpenError: the film cannot be opened.
    """
    stream = KlvStream()
    sets, size = _read(path, stream)
    if stream.damaged:
        faults.append(f"KLV metadata: {counted(stream.damaged, 'damaged set')} skipped")
    if not sets:
        return []
    sets.sort(key=lambda one: one[0])
    stamps_ns = np.array([stamp_ns for stamp_ns, _ in sets], np.int64)
    values = _Values(stamps_ns, [one for _, one in sets])
    table = LogTable(_TABLE, {_TIME: (stamps_ns // 1000).astype(np.uint64), **values.columns})
    logged = logged_series("misb", {_TABLE: table}, {_TABLE: values.format}, 0)
    return [
        *camera_series(_poses(values)),
        *lens_series(_lenses(values, size)),
        *(replace(one, topic=one.topic.lstrip("/")) for one in logged),
    ]


def _read(path: Path, stream: KlvStream) -> tuple[list[tuple[int, _Set]], Size]:
    """The sets with their times in the film, and the size of its images."""
    sets: list[tuple[int, _Set]] = []
    most = object_limit() // 50
    with open_container(path) as container:
        tracks = [one for one in container.streams if one.type == "data"]
        if container.format.name != _FORMAT or not tracks:
            return [], (0, 0)
        video = video_stream(container, path)
        size = (video.codec_context.width, video.codec_context.height)
        origin, stamp_ns = video.start_time or 0, 0
        try:
            for packet in container.demux(tracks):
                if packet.pts is not None and packet.time_base is not None:
                    since = packet.pts * packet.time_base - origin * (video.time_base or 0)
                    stamp_ns = max(round(since * 10**9), 0)
                sets += [(stamp_ns, one) for one in stream.feed(bytes(packet))]
                if len(sets) > most:
                    break
        except (FFmpegError, OSError, IndexError):  # the last of a damaged table of streams
            pass  # what is cut off is noted where the images are read
    stream.finish()
    return sets, size


class _Values:
    """The values of all sets as columns (N,), NaN or empty where one is missing."""

    def __init__(self, stamps_ns: _Times, sets: Sequence[_Set]) -> None:
        self.stamps_ns = stamps_ns
        kinds = {name: type(value) for one in sets for name, value in one.items()}
        self.columns: dict[str, npt.NDArray[np.generic]] = {}
        self.format: LogFields = [("uint64_t", 0, _TIME)]
        for name, kind in kinds.items():
            if kind is str:
                texts = [str(one.get(name, "")).encode() for one in sets]
                self.columns[name] = np.array(texts, object)
                self.format.append(("string", 0, name))
            else:
                self.columns[name] = np.array([one.get(name, np.nan) for one in sets], np.float64)
                self.format.append(("double", 0, name))

    def column(self, name: str) -> Floats:
        """(N,) numbers; the last known one holds for a second."""
        values = self.columns.get(name)
        if values is None or values.dtype != np.float64:
            return np.full(len(self.stamps_ns), np.nan)
        known = np.isfinite(np.asarray(values, np.float64))
        last = np.maximum.accumulate(np.where(known, np.arange(len(known)), 0))
        age_ns = self.stamps_ns - self.stamps_ns[last]
        held: Floats = np.where(known[last] & (age_ns <= _HELD_NS), values[last], np.nan)
        return held

    def angles(self, names: Sequence[str]) -> Floats:
        """(N, 4) rotations of yaw, pitch and roll in degrees; of no roll that of the horizon."""
        yaw, pitch, roll = (self.column(name) for name in names)
        for number, whole in enumerate((pitch, roll), 1):
            full = self.column(f"{names[number]}_full")
            np.copyto(whole, full, where=np.isfinite(full))
        roll = np.where(np.isfinite(roll), roll, 0)
        return rotations.from_rpy(np.radians(np.column_stack([roll, pitch, yaw])))


def _poses(values: _Values) -> CameraPoses:
    altitude, ground_m = _altitudes(values)
    center = [values.column(f"frame_center_{name}") for name in ("latitude", "longitude")]
    seen = np.flatnonzero(np.isfinite(center[0] + center[1]))
    ground_at = (float(center[0][seen[0]]), float(center[1][seen[0]])) if len(seen) else None
    places = np.column_stack(
        [values.column("sensor_latitude"), values.column("sensor_longitude"), altitude]
    )
    body, sensor = values.angles(_BODY), values.angles(_SENSOR)
    quats = optical_quats(rotations.multiply(body, sensor))
    return CameraPoses(values.stamps_ns, places, quats, ground_m, ground_at)


def _altitudes(values: _Values) -> tuple[Floats, float]:
    """Altitudes (N,) of the camera, and the first one of the ground; NaN if unknown."""
    for name, ground in _ALTITUDES:
        altitude, below = values.column(name), values.column(ground)
        if np.isfinite(altitude).any() and np.isfinite(below).any():
            return altitude, float(below[np.isfinite(below)][0])
    found = (values.column(name) for name, _ in _ALTITUDES)
    return next((one for one in found if np.isfinite(one).any()), next(found, altitude)), np.nan


def _lenses(values: _Values, size: Size) -> Iterator[tuple[int, CameraInfo]]:
    """The lens by each field of view."""
    last = 0.0
    for stamp_ns, degrees in zip(
        values.stamps_ns.tolist(), values.column("sensor_horizontal_fov").tolist(), strict=True
    ):
        if 0 < degrees < 175 and abs(degrees - last) > _ZOOM * degrees and min(size) > 0:
            last = degrees
            yield stamp_ns, lens_of_angle(degrees, size)
