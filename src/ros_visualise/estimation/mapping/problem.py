"""Recorded tag sightings as arrays, and the unknown poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ros_visualise.data import CameraInfo, Floats, Hypothesis
from ros_visualise.estimation.mapping.normal import Numbers
from ros_visualise.estimation.mapping.outward import outward_steps
from ros_visualise.landmarks.pose import corner_sigma
from ros_visualise.landmarks.pose.estimating import SQUARE
from ros_visualise.landmarks.pose.rays import Rays, rays_of
from ros_visualise.sources.calibration import CalibrationUncertainty

Flags = npt.NDArray[np.bool_]
"""Masks of views, tags or sightings."""


class Poses(NamedTuple):
    """Poses R_map_body (N, 3, 3) and t (N, 3), metres."""

    R: Floats
    t: Floats

    def at(self, rows: Numbers) -> Poses:
        """Those of these indices (S,)."""
        return Poses(self.R[rows], self.t[rows])

    def compose(self, other: Poses) -> Poses:
        """Each pose, then the other (N,) in its frame."""
        return Poses(self.R @ other.R, self.t + (self.R @ other.t[..., None])[..., 0])


@dataclass(frozen=True, eq=False)
class RigCamera:
    """A camera of a rig. The pose of a view is that of the rig's first camera.

    Attributes:
        name: its topic.
        T_first_camera: (4, 4) its pose in the frame of the first camera.
        sigma_m, sigma_rad: standard deviations of that pose along and about each axis.
        calibration: the uncertainty of its calibration; None if unknown.
        is_estimated: True if its pose is not known by tf but from the views.
        is_wrong: True if the views contradict its pose by tf.
        is_exact: True if its calibration has no errors, as in a simulation.
    """

    name: str = ""
    T_first_camera: Floats = field(default_factory=lambda: np.eye(4))
    sigma_m: float = 0.0
    sigma_rad: float = 0.0
    calibration: CalibrationUncertainty | None = None
    is_estimated: bool = False
    is_wrong: bool = False
    is_exact: bool = True


@dataclass(frozen=True, eq=False)
class TagSighting:
    """One tag in one image.

    Attributes:
        view, tag: indices of both.
        corners_uv: (4, 2) pixels, anticlockwise from the lower left.
        size_m: side of its square.
        info: the camera's calibration.
        hypotheses: its possible poses in the camera's frame, the likeliest first.
        camera: index of the rig's camera.
    """

    view: int
    tag: int
    corners_uv: Floats
    size_m: float
    info: CameraInfo
    hypotheses: Sequence[Hypothesis]
    camera: int = 0


@dataclass(frozen=True, eq=False)
class CameraPath:
    """T_fixed_camera (N, 4, 4): camera poses by tf, in a frame with upright z axis.

    They are those of the rig's first camera.
    """

    T_fixed_camera: Floats


@dataclass(frozen=True, eq=False)
class TagPrior:
    """A surveyed tag: its position, and its orientation unless that is None.

    Standard deviations are (3,) metres along the axes of the map, and (3,) radians about them.
    """

    tag: int
    position_xyz: Floats
    position_sigma: Floats
    R: Floats | None = None
    R_sigma: Floats = field(default_factory=lambda: np.full(3, 0.01))


@dataclass(frozen=True, eq=False)
class DistancePrior:
    """A measured distance between the centres of two tags, metres."""

    tags: tuple[int, int]
    distance_m: float
    sigma_m: float


@dataclass(frozen=True, eq=False)
class Problem:
    """All data; see `TagSighting`, `CameraPath` and the priors.

    Attributes:
        stamps_ns: (N,) of the views: all images of a rig's cameras at one time.
        names: of the tags.
        anchor: the tag whose frame is the map's, without odometry and survey.
    """

    stamps_ns: npt.NDArray[np.int64]
    names: Sequence[str]
    sightings: Sequence[TagSighting]
    odometry: CameraPath | None = None
    surveyed: Sequence[TagPrior] = ()
    distances: Sequence[DistancePrior] = ()
    anchor: int = 0
    cameras: Sequence[RigCamera] = (RigCamera(),)

    @property
    def counts(self) -> tuple[int, int]:
        """Numbers of views and tags."""
        return len(self.stamps_ns), len(self.names)

    def restricted(self, views: Flags, tags: Flags) -> Problem:
        """The problem with only some views (N,) and tags (M,), given as masks."""
        view, tag = np.cumsum(views) - 1, np.cumsum(tags) - 1
        odometry = self.odometry
        return Problem(
            self.stamps_ns[views],
            [name for name, is_in in zip(self.names, tags, strict=True) if is_in],
            [
                replace(one, view=int(view[one.view]), tag=int(tag[one.tag]))
                for one in self.sightings
                if views[one.view] and tags[one.tag]
            ],
            odometry and replace(odometry, T_fixed_camera=odometry.T_fixed_camera[views]),
            [replace(one, tag=int(tag[one.tag])) for one in self.surveyed if tags[one.tag]],
            [
                replace(one, tags=(int(tag[one.tags[0]]), int(tag[one.tags[1]])))
                for one in self.distances
                if tags[list(one.tags)].all()
            ],
            int(tag[self.anchor]) if tags[self.anchor : self.anchor + 1].any() else 0,
            self.cameras,
        )


class Corners(NamedTuple):
    """The corners of S sightings."""

    views: Numbers
    """(S,) indices of the views."""
    tags: Numbers
    """(S,) indices of the tags."""
    cameras: Numbers
    """(S,) indices of the cameras."""
    points: Floats
    """(S, 4, 3) metres in the tag's frame."""
    rays: Rays
    """(S, 4, ...) through their pixels."""
    sigma_px: Floats
    """(S,) standard deviation of each coordinate, from the tag's size in the image."""
    outward: Floats
    """(S, 4, 2) shift of the corners if tags appear one pixel too large."""


def corners_of(sightings: Sequence[TagSighting]) -> Corners:
    """The sightings as arrays.

    Raises:
        UnsupportedImage: unknown distortion model.
    """
    views = np.array([one.view for one in sightings], int)
    tags = np.array([one.tag for one in sightings], int)
    cameras = np.array([one.camera for one in sightings], int)
    corners = np.array([one.corners_uv for one in sightings]).reshape(-1, 4, 2)
    sizes = np.array([one.size_m for one in sightings])
    directions, to_pixels = np.empty((len(views), 4, 3)), np.empty((len(views), 4, 2, 3))
    for info, rows in _by_camera(sightings):
        directions[rows], to_pixels[rows] = rays_of(corners[rows], info)
    return Corners(
        views,
        tags,
        cameras,
        SQUARE * sizes[:, None, None],
        Rays(directions, to_pixels),
        corner_sigma(corners),
        outward_steps(corners),
    )


def _by_camera(sightings: Sequence[TagSighting]) -> list[tuple[CameraInfo, list[int]]]:
    rows: dict[tuple[bytes, ...], tuple[CameraInfo, list[int]]] = {}
    for row, one in enumerate(sightings):
        info = one.info
        key = (info.K.tobytes(), info.D.tobytes(), info.R.tobytes())
        rows.setdefault(key, (info, []))[1].append(row)
    return list(rows.values())
