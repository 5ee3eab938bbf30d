"""Directions of the corners of an image, by one camera or two, and keyframes of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ros_visualise.data import CameraInfo, Floats, Pixels
from ros_visualise.estimation.visual.keyframes import Keyframe
from ros_visualise.estimation.visual.rolling import directions_at_once
from ros_visualise.landmarks.pose.rays import rays_of
from ros_visualise.vision.rectification import Interpolation, model_of, rectify
from ros_visualise.vision.tracking import FollowedCorners, flow


class SeenImage(NamedTuple):
    """An image with the directions of its corners (N, 2); ``right`` is that of a second camera."""

    stamp_ns: int
    gray: Pixels
    right: Pixels | None
    corners: FollowedCorners
    rays: Floats


class CameraSights:
    """See the module.

    Args:
        infos: calibrations of one camera, or of two.
        readout_s: time from the first to the last row of an image.
    """

    def __init__(self, infos: Sequence[CameraInfo], readout_s: float) -> None:
        self.infos, self.readout_s = infos, readout_s
        self._model = model_of(infos[0], -1)
        self._key = 0

    @property
    def camera(self) -> Floats:
        """(3, 3) K of the images of keyframes."""
        K: Floats = self._model.P[:, :3]
        return K

    def rays(self, corners: FollowedCorners, seconds: float) -> Floats:
        """(N, 2) directions of corners, as if all rows were read at once."""
        return directions_at_once(corners, self.infos[0], self.readout_s, seconds)

    def _directions(self, pixels: Floats, camera: int) -> Floats:
        rays = rays_of(pixels, self.infos[camera]).directions
        return rays[:, :2] / rays[:, 2:]

    def both(self, image: SeenImage) -> Floats:
        """(C, N, 2) directions of the corners of an image by all cameras."""
        if image.right is None:
            return np.array([image.rays])
        pixels, found = flow(image.gray, image.right, image.corners.pixels_uv)
        right = np.where(found[:, None], self._directions(pixels, 1), np.nan)
        return np.stack([image.rays, right])

    def at_stamp(self, first: SeenImage, image: SeenImage) -> SeenImage:
        """The first image, its corners corrected for the readout by their motion to the next."""
        _, a, b = np.intersect1d(first.corners.ids, image.corners.ids, True, return_indices=True)
        corners, after = first.corners.chosen(a), image.corners.pixels_uv[b]
        turned = FollowedCorners(corners.ids, corners.pixels_uv, 2 * corners.pixels_uv - after)
        rays = self.rays(turned, (image.stamp_ns - first.stamp_ns) / 1e9)
        return first._replace(corners=corners, rays=rays)

    def keyframe(self, image: SeenImage, R: Floats, p: Floats) -> Keyframe:
        """A keyframe of an image, at a pose T_map_camera."""
        self._key += 1
        gray = rectify(image.gray, self._model, Interpolation.LINEAR)
        ids, rays = image.corners.ids, self.both(image)
        return Keyframe(self._key - 1, image.stamp_ns, R, p, ids, rays, gray)
