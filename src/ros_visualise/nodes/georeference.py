"""The node that places detections on the Earth."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ros_visualise.core.errors import NoTransform
from ros_visualise.core.params import param
from ros_visualise.data import (
    CameraInfo,
    Detection,
    Detection3D,
    Detections,
    Detections3D,
    Floats,
    Header,
    Hypothesis,
    NavSatFix,
    Text,
)
from ros_visualise.estimation.localization.seen import UNKNOWN
from ros_visualise.geometry.aircraft import R_body_camera
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.geometry.se3 import from_parts, turn_between
from ros_visualise.landmarks.georeferencing.course import HEADING_RAD, TILT_RAD, Course
from ros_visualise.landmarks.georeferencing.ground import (
    LevelSurface,
    Surface,
    ViewErrors,
    ground_points,
    measured_point,
)
from ros_visualise.landmarks.georeferencing.origin import (
    BODY,
    GIMBAL,
    MAP,
    MapOrigin,
    OriginFinder,
    map_frame,
)
from ros_visualise.landmarks.georeferencing.terrain import TerrainSurface, check_terrain
from ros_visualise.landmarks.once_log import OnceLog
from ros_visualise.landmarks.pose.rays import rays_of
from ros_visualise.nodes import node
from ros_visualise.sinks.geography import GeoPlace, to_geojson
from ros_visualise.vision.lens_table import find_lens
from ros_visualise.vision.reshape import resized

_OUTPUTS = {"positions": Detections3D, "geojson": Text, "map_origin": NavSatFix}
_LEVEL = np.array([0.0, 0.0, 0.0, 1.0])
_CALIBRATED = 0.003  # error of a calibrated focal length, as a fraction
_LOOK_NS = 50_000_000  # for the camera's velocity
_BOX, _PIXEL = 0.1, 1.0  # deviations of a point, as a fraction of its box, and in pixels


@dataclass(frozen=True)
class GeoreferenceParams:
    """Parameters of `Georeference`."""

    fixed_frame: str = param(
        MAP,
        "frame with x east, y north, z up; if no frame named map exists, odom is used instead",
    )
    camera_pitch: float = param(
        90.0,
        "downward tilt from the horizon, degrees, of a camera fixed to base_link, if its frame is"
        " not on /tf; 90: straight down, with the top of its image forward",
        min=-90,
        max=90,
    )
    course: bool = param(
        False,
        "where /tf has no attitude, assume that the camera looks along the course of the GPS fixes,"
        " camera_pitch degrees below the horizon",
    )
    lens: str = param(
        "",
        "lens of an uncalibrated camera: its horizontal field of view, degrees, or its name, such"
        " as mini 2; empty: as the source says",
    )
    lens_sigma: float = param(
        0.05,
        "standard deviation of an uncalibrated focal length, as a fraction of it",
        min=0,
        max=1,
        slider=(0, 0.2),
        group="uncertainty",
    )
    attitude_sigma: float = param(
        1.0,
        "standard deviation of the camera's tilt, degrees",
        min=0,
        max=45,
        slider=(0, 5),
        group="uncertainty",
    )
    heading_sigma: float = param(
        3.0,
        "standard deviation of the camera's heading, degrees",
        min=0,
        max=180,
        slider=(0, 20),
        group="uncertainty",
    )
    position_sigma: float = param(
        3.0,
        "standard deviation of the camera's position east and north, metres; used if the GPS fixes"
        " report none",
        min=0,
        max=1e4,
        slider=(0, 10),
        group="uncertainty",
    )
    height_sigma: float = param(
        1.0,
        "standard deviation of the camera's height above the take-off point, metres",
        min=0,
        max=1e4,
        slider=(0, 10),
        group="uncertainty",
    )
    time_sigma: float = param(
        0.0,
        "standard deviation of the time offset between images and camera poses, seconds",
        min=0,
        max=10,
        slider=(0, 0.5),
        group="uncertainty",
    )
    ground_height: float = param(
        0.0,
        "height of the ground in the fixed frame, metres",
        min=-1e4,
        max=1e4,
        slider=(-50, 50),
        group="ground",
    )
    ground_sigma: float = param(
        1.0,
        "standard deviation of the ground's height, metres",
        min=0,
        max=1e4,
        slider=(0, 20),
        group="ground",
    )
    terrain: str = param(
        "",
        "file with a terrain model, such as GeoTIFF or .hgt, to use instead of level ground; needs"
        " the pip extra [terrain]",
        group="ground",
        file=bool,
    )
    terrain_shift: float = param(
        0.0,
        "offset added to the heights of the terrain model, such as the geoid's height, metres;"
        " unused if the take-off point is known",
        min=-1e4,
        max=1e4,
        slider=(-100, 100),
        group="ground",
    )

    def __post_init__(self) -> None:
        if self.lens:
            find_lens(self.lens, (4, 3))


@node(
    "georeference",
    params=GeoreferenceParams,
    inputs={
        "detections": Detections,
        "objects": Detections,
        "fix": NavSatFix,
        "map_origin": NavSatFix,
        "lens": CameraInfo,
    },
    outputs=_OUTPUTS,
    topics={name: f"/georeference/{name}" for name in _OUTPUTS},
    latched=("map_origin",),
    frames=True,
    splittable=False,
)
class Georeference:
    """Places detections on the Earth, with covariances, where their rays meet the ground.

    Tags with a known size are placed by their own distance. ``positions`` are in the fixed frame,
    whose origin is ``map_origin``; ``geojson`` has latitudes, longitudes and heights. The origin is
    that of the source, else it is estimated from fixes.
    """

    def __init__(self, params: GeoreferenceParams) -> None:
        if params.terrain:
            check_terrain(Path(params.terrain))
        self._remarks = OnceLog("georeference")
        self._lens: CameraInfo | None = None
        self._surface: tuple[Any, Surface] | None = None
        self._placed = 0
        self._rejected: Counter[str] = Counter()
        self.reset()

    def reset(self) -> None:
        """Forget fixes: time jumped."""
        self._finder, self._course = OriginFinder(), Course()
        self._place_m2: Floats | None = None
        self._camera = ""

    def step(
        self,
        params: GeoreferenceParams,
        detections: Detections | None = None,
        objects: Detections | None = None,
        fix: NavSatFix | None = None,
        map_origin: NavSatFix | None = None,
        lens: CameraInfo | None = None,
        *,
        frames: FrameTree,
    ) -> dict[str, Any] | None:
        """The places of an image's detections; ``objects`` are those of a second detector."""
        self._lens = lens or self._lens
        if map_origin is not None:
            self._finder.given = MapOrigin.of(map_origin)
        if fix is not None:
            self._take_fix(fix, params, frames)
        found = objects if detections is None else detections
        if found is None:
            return None
        self._camera = found.header.frame_id
        return self._answer(found, params, frames)

    def report(self) -> dict[str, Any]:
        """Numbers of placed detections, and of rejected ones by reason."""
        return {"placed": self._placed, "rejected": dict(self._rejected)}

    def _take_fix(self, fix: NavSatFix, params: GeoreferenceParams, frames: FrameTree) -> None:
        if fix.status >= 0 and fix.covariance.any():
            self._place_m2 = fix.covariance[:2, :2]
        if _is_by_course(params, frames, self._camera):
            self._course.take(fix)
            return
        sigmas = np.array([1.0, 1.0, 2.0]) * params.position_sigma
        fixed = map_frame(params.fixed_frame, frames)
        if not self._finder.take(fix, fixed, (BODY, self._camera), frames, sigmas):
            self._remarks.say(f"no frame {fix.header.frame_id} or {BODY}: fixes are not used")

    def _answer(
        self, found: Detections, params: GeoreferenceParams, frames: FrameTree
    ) -> dict[str, Any] | None:
        stamp_ns, several = found.header.stamp_ns, [d for d in found.detections if d.hypotheses]
        is_by_course = _is_by_course(params, frames, self._camera)
        origin = self._finder.origin or (self._course.origin if is_by_course else None)
        if origin is None:
            self._reject(len(several), "no position yet: give fixes, as on /fix")
            return None
        fixed, T = params.fixed_frame, None
        if is_by_course:
            T = self._course.pose(origin, stamp_ns, params.camera_pitch)
        else:
            fixed = map_frame(params.fixed_frame, frames)
            T = self._camera_pose(fixed, stamp_ns, params, frames)
        if T is None:
            self._reject(len(several), "no course: it has not moved yet, or has no fixes")
            return None
        info, lens_sigma = self._lens_of(found, params)
        errors = self._errors(params, origin, lens_sigma, frames, fixed, stamp_ns)
        surface = self._surface_at(origin, params)
        if surface is None:
            why = "the height above the ground is unknown: set ground_height or terrain"
            self._reject(len(several), why)
            return None
        ranged = [(one, near) for one in several if (near := _ranged(one)) is not None]
        rays = [one for one in several if _ranged(one) is None]
        placed = [_placed(one, *measured_point(near, T, errors)) for one, near in ranged]
        placed += self._on_ground(rays, info, T, errors, surface)
        self._placed += len(placed)
        header = Header(stamp_ns, fixed)
        return {
            "positions": Detections3D(tuple(placed), header),
            "geojson": Text(to_geojson(geo_places(placed, origin, stamp_ns)), header),
            "map_origin": origin.message(stamp_ns, fixed),
        }

    def _on_ground(
        self,
        rays: Sequence[Detection],
        info: CameraInfo | None,
        T_fixed_camera: Floats,
        errors: ViewErrors,
        surface: Surface,
    ) -> list[Detection3D]:
        """Detections whose distance is not measured, where their rays meet the ground."""
        if rays and info is None:
            self._reject(len(rays), "no lens: give a calibration, or set lens")
        if not rays or info is None:
            return []
        pixels, covariances = _pixels(rays, info, T_fixed_camera)
        points = ground_points(pixels, covariances, info, T_fixed_camera, errors, surface)
        placed = []
        for one, reason, position, covariance in zip(
            rays, points.rejected, points.positions_xyz, points.covariances_m2, strict=True
        ):
            if reason:
                self._reject(1, reason)
            else:
                placed.append(_placed(one, position, covariance))
        return placed

    def _camera_pose(
        self, fixed: str, stamp_ns: int, params: GeoreferenceParams, frames: FrameTree
    ) -> Floats:
        known = frames.frames()
        if self._camera in known or BODY not in known:
            return frames.lookup(fixed, self._camera, stamp_ns)
        if GIMBAL in known:
            self._remarks.say(
                f"no frame {self._camera}: camera assumed to point the same way as {GIMBAL}"
            )
            T_gimbal_camera = from_parts(R_body_camera(0.0), np.zeros(3))
            return frames.lookup(fixed, GIMBAL, stamp_ns) @ T_gimbal_camera
        self._remarks.say(
            f"no frame {self._camera}: camera assumed fixed to {BODY}, {params.camera_pitch:g}"
            " degrees below the horizon (camera_pitch)"
        )
        T_base_camera = from_parts(R_body_camera(params.camera_pitch), np.zeros(3))
        return frames.lookup(fixed, BODY, stamp_ns) @ T_base_camera

    def _reject(self, count: int, why: str) -> None:
        if count:
            self._rejected[why.partition(":")[0]] += count
            self._remarks.say(f"not placed: {why}")

    def _lens_of(
        self, found: Detections, params: GeoreferenceParams
    ) -> tuple[CameraInfo | None, float]:
        """The lens of an image, and the error of its focal length."""
        info = found.camera_info
        if info is not None and info.K[0, 0] > 0:
            return info, _CALIBRATED
        lens, size = self._lens, found.size
        if params.lens:
            size = size or (None if lens is None else (lens.width, lens.height))
            return (find_lens(params.lens, size) if size else None), params.lens_sigma
        if lens is not None and size and size != (lens.width, lens.height):
            lens = resized(lens, (lens.width, lens.height), size)
        return lens, params.lens_sigma

    def _errors(
        self,
        params: GeoreferenceParams,
        origin: MapOrigin,
        lens_sigma: float,
        frames: FrameTree,
        fixed: str,
        stamp_ns: int,
    ) -> ViewErrors:
        place_m2 = origin.covariance_m2[:2, :2]
        if not place_m2.any():
            none = params.position_sigma**2 * np.eye(2)
            place_m2 = none if self._place_m2 is None else self._place_m2
        moved, turned = np.zeros(3), np.zeros(3)
        if params.time_sigma:
            moved, turned = _motion(frames, fixed, self._camera, stamp_ns)
        moved, turned = params.time_sigma * moved, params.time_sigma * turned
        tilt, heading = math.radians(params.attitude_sigma), math.radians(params.heading_sigma)
        if _is_by_course(params, frames, self._camera):
            tilt, heading = math.hypot(tilt, TILT_RAD), math.hypot(heading, HEADING_RAD)
        return ViewErrors(
            math.hypot(tilt, *turned[:2]),
            math.hypot(heading, turned[2]),
            math.hypot(params.height_sigma, moved[2]),
            params.ground_sigma,
            lens_sigma,
            place_m2 + np.outer(moved[:2], moved[:2]),
        )

    def _surface_at(self, origin: MapOrigin, params: GeoreferenceParams) -> Surface | None:
        """The ground; None if its height is unknown."""
        if not params.terrain:
            known = origin.has_ground or params.ground_height
            return LevelSurface(params.ground_height) if known else None
        key = (params.terrain, params.terrain_shift, *origin.place[:2].round(4), origin.has_ground)
        if self._surface is None or self._surface[0] != key:
            base = None if origin.has_ground else float(origin.place[2]) - params.terrain_shift
            place = float(origin.place[0]), float(origin.place[1])
            self._surface = key, TerrainSurface(Path(params.terrain), *place, base)
        return self._surface[1]


def _is_by_course(params: GeoreferenceParams, frames: FrameTree, camera: str) -> bool:
    return params.course and not {camera, BODY, GIMBAL} & set(frames.frames())


def geo_places(placed: Sequence[Detection3D], origin: MapOrigin, stamp_ns: int) -> list[GeoPlace]:
    """Placed detections on the Earth."""
    if not placed:
        return []
    places = origin.plane.from_enu([one.position_xyz for one in placed])
    return [
        GeoPlace(
            _name(one),
            one.class_id,
            place,
            one.hypotheses[0].covariance[:3, :3],
            1,
            stamp_ns,
        )
        for one, place in zip(placed, places, strict=True)
    ]


def _name(one: Detection3D) -> str:
    """Its class, which is a tag's own, and the number of others."""
    is_own = not one.id or one.class_id == one.id or one.class_id.endswith(f"_{one.id}")
    return one.class_id if is_own else f"{one.class_id} #{one.id}"


def _motion(frames: FrameTree, fixed: str, camera: str, stamp_ns: int) -> tuple[Floats, Floats]:
    """Velocity and angular velocity (3,) of the camera; zero if unknown."""
    try:
        before, after = (
            frames.lookup(fixed, camera, stamp_ns + sign * _LOOK_NS, _LOOK_NS / 1e9)
            for sign in (-1, 1)
        )
    except NoTransform:
        return np.zeros(3), np.zeros(3)
    elapsed_s = 2 * _LOOK_NS / 1e9
    turned = turn_between(after[:3, :3], before[:3, :3])
    return (after[:3, 3] - before[:3, 3]) / elapsed_s, turned / elapsed_s


def _ranged(one: Detection) -> Hypothesis | None:
    """The hypothesis of a detection whose distance is measured."""
    best = one.best
    away, covariance = best.position_xyz, best.covariance[:3, :3]
    length = float(np.linalg.norm(away))
    if not (covariance.any() and np.isfinite(covariance).all() and 0 < length < math.inf):
        return None
    return best if away @ covariance @ away / length**2 < UNKNOWN else None


def _pixels(
    several: Sequence[Detection], info: CameraInfo, T_fixed_camera: Floats
) -> tuple[Floats, Floats]:
    """The pixels (N, 2) where detections touch the ground, and their covariances (N, 2, 2).

    Without a point of its own, a box stands at its centre when seen from above, at its lower edge
    when seen from the side.
    """
    centers = np.array([one.center_uv for one in several])
    sizes = np.array([one.size_uv for one in several])
    rays, down = rays_of(centers, info), -T_fixed_camera[2, :3]
    level = np.linalg.norm(np.cross(rays.directions, down), axis=1)
    along = rays.to_pixels @ down
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    reach = (np.abs(along) * sizes).sum(axis=1) / 2
    feet = centers + np.nan_to_num((level * reach)[:, None] * along)
    pixels, covariances = feet, np.zeros((len(several), 2, 2))
    for number, one in enumerate(several):
        if one.point_uv is not None:
            pixels[number], covariances[number] = one.point_uv, one.point_covariance
        else:
            covariances[number] = np.diag((_BOX * one.size_uv) ** 2)
        covariances[number] += _PIXEL**2 * np.eye(2)
    return pixels, covariances


def _placed(one: Detection, position: Floats, covariance: Floats) -> Detection3D:
    best = one.best
    whole = np.diag([0.0, 0, 0, *3 * [10 * UNKNOWN]])
    whole[:3, :3] = covariance
    found = Hypothesis(best.class_id, best.score, position, _LEVEL, whole, best.number)
    return Detection3D(position, _LEVEL, np.zeros(3), (found,), one.id)
