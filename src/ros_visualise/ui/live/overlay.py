"""Points of a cloud over an image, coloured by their distance."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import NoTransform
from ros_visualise.data import CameraInfo, Floats, Image, Pixels, PointCloud
from ros_visualise.geometry import se3
from ros_visualise.geometry.thinning import evenly
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.feed import Feed
from ros_visualise.ui.live.space.shown import ShownSpace
from ros_visualise.ui.scene.frames import Frames
from ros_visualise.vision.measurements import turbo
from ros_visualise.vision.projection import project

_NEAR_M, _FAR_M = 2.0, 45.0
_MAX_POINTS = 60_000
_DOT = 500  # an image of so many pixels' width has dots one pixel larger


class Overlay:
    """The newest cloud of a topic, over images of a calibrated camera.

    Args:
        shown: the 3D view, which knows frames and calibrations.
        topic: of the clouds; empty: none are drawn.
    """

    def __init__(self, runtime: Runtime, shown: ShownSpace, topic: str) -> None:
        self._topic, self._shown = topic, shown
        self._feed = Feed(runtime)
        self._cloud: PointCloud | None = None

    def refresh(self) -> bool:
        """Take the newest cloud; True if the picture changes."""
        before = self._cloud
        self._feed.follow(self._topic or None)
        self._cloud = self._feed.take() or self._cloud
        return self._cloud is not before

    def close(self) -> None:
        """Unsubscribe."""
        self._feed.follow(None)

    @property
    def is_empty(self) -> bool:
        """True if there is nothing to draw."""
        return self._cloud is None

    def draw(self, image: Image, topic: str, shown: Pixels) -> Pixels:
        """The picture ``shown`` of an image, 8-bit RGB of any size, with the points over it."""
        space = self._shown()
        if self._cloud is None or space is None:
            return shown
        space.drawing.take_frames()
        scene, frame = space.scene, image.header.frame_id
        if image.camera_info is not None:
            scene.calibrations[frame] = image.camera_info
        info = choose_calibration(image, scene.calibrations.get(frame))
        if info is None:
            return shown
        try:
            T_camera_cloud = between(scene.frames, image, self._cloud)
            return paint(shown, self._cloud, T_camera_cloud, info, is_rectified(topic, info))
        except (NoTransform, ValueError):
            return shown  # unknown as yet, or an unsupported distortion model


def choose_calibration(image: Image, known: CameraInfo | None) -> CameraInfo | None:
    """The calibration that came with an image, else one of its frame for images of this size."""
    info = image.camera_info or known
    if info is None or info.K[0, 0] <= 0:
        return None
    return info if (info.width, info.height) == (image.width, image.height) else None


def is_rectified(topic: str, info: CameraInfo) -> bool:
    """True if P of the calibration applies to the images of a topic, rather than K, D and R.

    It does if a part of the topic's name begins as image_proc names its outputs, as in
    ``image_rect``, ``image_rect_color`` and ``image_rect/compressed``; and if rectification would
    change nothing: no distortion, no rotation, and P has the K of the image. Images derived from
    others, under other names, count as not rectified.

    Source: image_proc's topics; sensor_msgs/CameraInfo.
    """
    if any(part.startswith("image_rect") for part in topic.split("/")):
        return True
    is_plain = not np.any(info.D) and np.array_equal(info.R, np.eye(3))
    return is_plain and info.P is not None and np.array_equal(info.P[:, :3], info.K)


def between(frames: Frames, image: Image, cloud: PointCloud) -> Floats:
    """T_camera_cloud, 4x4: from the cloud at its time to the camera at the image's.

    Raises:
        NoTransform: it is unknown.
    """
    one, other = image.header, cloud.header
    for header in (one, other):
        frames.see(header.frame_id)
    T_fixed_camera = frames.locate(one.frame_id, one.stamp_ns)
    T_fixed_cloud = frames.locate(other.frame_id, other.stamp_ns)
    return se3.inverse(T_fixed_camera) @ T_fixed_cloud


def paint(
    shown: Pixels, cloud: PointCloud, T_camera_cloud: Floats, info: CameraInfo, rectified: bool
) -> Pixels:
    """A picture with a cloud's points, the nearer ones over the farther ones.

    Raises:
        ValueError: unsupported camera model.
    """
    xyz = cloud.xyz
    xyz = xyz[evenly(len(xyz), _MAX_POINTS)]
    points = se3.apply(T_camera_cloud, xyz)
    pixels, in_front = project(points, info, rectified)
    places = scaled(pixels, info, shown.shape[:2])
    height, width = shown.shape[:2]
    inside = in_front & (places >= 0).all(axis=1)
    inside &= (places[:, 0] < width) & (places[:, 1] < height)
    far = points[inside, 2]
    order = np.argsort(-far)
    colors = turbo(-np.log(far[order]), -float(np.log(_FAR_M)), -float(np.log(_NEAR_M)))
    return _dot(shown, places[inside][order], colors)


def scaled(
    pixels_uv: npt.NDArray[np.floating], info: CameraInfo, shape: tuple[int, ...]
) -> npt.NDArray[np.intp]:
    """Pixels (N, 2) of an image, as those of a picture (height, width) of it: (N, 2) whole."""
    scale = np.array([shape[1] / info.width, shape[0] / info.height])
    bounded = np.clip(pixels_uv, -1e6, 1e6)  # or they would not fit an integer
    places: npt.NDArray[np.intp] = np.floor((bounded + 0.5) * scale).astype(np.intp)
    return places


def _dot(shown: Pixels, places: npt.NDArray[np.intp], colors: Pixels) -> Pixels:
    picture: Pixels = shown.copy()
    height, width = picture.shape[:2]
    size = 1 + round(width / _DOT)
    for dy in range(size):
        for dx in range(size):
            x = np.minimum(places[:, 0] + dx, width - 1)
            y = np.minimum(places[:, 1] + dy, height - 1)
            picture[y, x] = colors
    return picture
