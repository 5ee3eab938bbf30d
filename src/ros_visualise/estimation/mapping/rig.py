"""Several cameras on one rig: images of one time, and the poses of the cameras in the rig.

Images of different cameras with the same timestamp are one view. Where tf does not give the poses
of the cameras, they follow from a first map, in which each image is a view of its own.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ros_visualise.core.printing import escaped
from ros_visualise.data import Detections, Floats
from ros_visualise.estimation.gates import GATES
from ros_visualise.estimation.mapping.intrinsics import root_of
from ros_visualise.estimation.mapping.problem import Problem, RigCamera
from ros_visualise.estimation.mapping.smoothing import SmoothedMap, smooth
from ros_visualise.estimation.mapping.unknowns import SharedLayout, SharedPrior
from ros_visualise.geometry.se3 import from_parts, inverse, rotation_vectors, to_pose
from ros_visualise.landmarks.pose.refinement import turn

CameraImage = tuple[int, Detections]
"""The index of a camera, and what was detected in one of its images."""

GIVEN_M, GIVEN_RAD = 0.02, np.deg2rad(2.0)
"""Standard deviations of the pose of a camera in the rig by tf."""
_FREE_M, _FREE_RAD = 0.5, 0.3  # of one that is estimated
_WIDER = np.geomspace(1, _FREE_M / GIVEN_M, 40)
_TOGETHER_NS = 1_000_000  # images that are as near in time are one view
_LEAST_PAIRS = 3


def views_of(images: Sequence[CameraImage], apart: Collection[int]) -> list[list[CameraImage]]:
    """Images in order of time, those of different cameras at one time together.

    Args:
        images: in any order.
        apart: cameras with an unknown pose in the rig, whose images are views of their own.
    """
    found: list[list[CameraImage]] = []
    view: list[CameraImage] = []
    for image in sorted(images, key=lambda one: (_stamp(one), one[0])):
        if image[0] in apart:
            found.append([image])
            continue
        is_again = image[0] in (camera for camera, _ in view)
        if not view or is_again or _stamp(image) - _stamp(view[0]) > _TOGETHER_NS:
            view = []
            found.append(view)
        view.append(image)
    return found


def estimated_rig(problem: Problem, cameras: Sequence[RigCamera]) -> dict[int, RigCamera]:
    """The cameras whose poses in the rig follow from the views.

    Args:
        problem: each image is a view.
        cameras: of the rig; the first one is its frame.
    """
    try:
        found = smooth(problem)
    except np.linalg.LinAlgError:
        return {}
    if found is None:
        return {}
    T_map_camera: dict[tuple[int, int], Floats] = {}
    for row, one in enumerate(found.problem.sightings):
        if found.inliers[row]:
            at = int(found.problem.stamps_ns[one.view]) // _TOGETHER_NS
            T = from_parts(found.views.R[one.view], found.views.t[one.view])
            T_map_camera[one.camera, at] = T
    rig = {}
    for camera in range(1, len(cameras)):
        both = [at for number, at in T_map_camera if number == camera and (0, at) in T_map_camera]
        if len(both) >= _LEAST_PAIRS:
            first = inverse(np.array([T_map_camera[0, at] for at in both]))
            T = _median(first @ np.array([T_map_camera[camera, at] for at in both]))
            rig[camera] = replace(
                cameras[camera],
                T_first_camera=T,
                sigma_m=_FREE_M,
                sigma_rad=_FREE_RAD,
                is_estimated=True,
            )
    return rig


def rig_as_found(found: SmoothedMap, prior: SharedPrior) -> SmoothedMap:
    """The map with poses of cameras by tf that count as much as they are found to deviate.

    A camera is wrong if its pose by the views alone differs from tf by more than chance; tf does
    not count for it. Few views may not show that: what they differ by then widens its deviations.
    """
    cameras = found.problem.cameras
    known = [n for n, one in enumerate(cameras) if n and one.sigma_m and not one.is_estimated]
    free = {n: replace(cameras[n], sigma_m=_FREE_M, sigma_rad=_FREE_RAD) for n in known}
    by_views = _with_cameras(found, free, prior) if known else None
    if by_views is None:
        return found
    layout, given = SharedLayout(by_views.problem.cameras), np.repeat([GIVEN_M, GIVEN_RAD], 3) ** 2
    changed = {}
    for camera in known:
        rows = layout.rig[camera]
        off, own = by_views.shared[rows], by_views.shared_covariance[rows, rows]
        if off @ np.linalg.solve(own + np.diag(given), off) > GATES[6]:
            changed[camera] = replace(free[camera], is_wrong=True)
            continue
        sigmas = (
            _deviation(off[:3], own[:3, :3], GIVEN_M),
            _deviation(off[3:], own[3:, 3:], GIVEN_RAD),
        )
        if sigmas != (GIVEN_M, GIVEN_RAD):
            changed[camera] = replace(cameras[camera], sigma_m=sigmas[0], sigma_rad=sigmas[1])
    return (_with_cameras(found, changed, prior) if changed else None) or found


def _with_cameras(
    found: SmoothedMap, changed: Mapping[int, RigCamera], prior: SharedPrior
) -> SmoothedMap | None:
    """The map with other cameras of these numbers."""
    cameras = [changed.get(n, one) for n, one in enumerate(found.problem.cameras)]
    return smooth(replace(found.problem, cameras=cameras), prior=prior)


def _deviation(off: Floats, spread: Floats, given: float) -> float:
    """The least standard deviation, at least the given one, at which a difference (3,) is usual."""
    variances, axes = np.linalg.eigh(spread)
    sigmas = given * _WIDER
    distances2 = ((off @ axes) ** 2 / (variances + sigmas[:, None] ** 2)).sum(axis=1)
    return float(sigmas[min((distances2 > len(off)).sum(), len(sigmas) - 1)])


@dataclass(frozen=True, eq=False)
class MappedCamera:
    """A camera of a rig as the map has it.

    Attributes:
        camera: the given one.
        first: name of the rig's first camera.
        T_first_camera: (4, 4) its pose in the frame of the first camera.
        shift_m, turn_deg: (3,) its pose relative to the given one.
        sigma_m, sigma_deg: (3,) standard deviations.
    """

    camera: RigCamera
    first: str
    T_first_camera: Floats
    shift_m: Floats
    turn_deg: Floats
    sigma_m: Floats
    sigma_deg: Floats

    @property
    def is_known(self) -> bool:
        """False if each of its images has a pose of its own."""
        return self.camera.sigma_m > 0

    @property
    def text(self) -> str:
        """A sentence for the report."""
        what = f"camera {escaped(self.camera.name)}"
        if not self.is_known:
            return (
                f"{what}: its pose relative to {escaped(self.first)} is unknown: not on tf, and too"
                " few pairs of images taken at the same time"
            )
        place = " ".join(f"{value:.4f}" for value in self.T_first_camera[:3, 3])
        where = f"at {place} m +- {self.sigma_m.max():.4f} m from {escaped(self.first)}"
        if self.camera.is_estimated:
            return f"{what}: {where}, orientation to within {self.sigma_deg.max():.2f} degrees"
        turned, shifted = np.linalg.norm(self.turn_deg), np.linalg.norm(self.shift_m)
        return (
            f"{what}: {where}; rotated by {turned:.2f} +- {self.sigma_deg.max():.2f} degrees and"
            f" shifted by {shifted:.3f} m relative to tf"
            + (": fix its transform" if self.camera.is_wrong else "")
        )

    @property
    def values(self) -> dict[str, Any]:
        """The same for programs."""
        position, quat = to_pose(self.T_first_camera)
        return {
            "name": self.camera.name,
            "known": self.is_known,
            "estimated": self.camera.is_estimated,
            "wrong": self.camera.is_wrong,
            "position": position.tolist(),
            "orientation": quat.tolist(),
            "shift_m": self.shift_m.tolist(),
            "turn_degrees": self.turn_deg.tolist(),
            "sigma_m": self.sigma_m.tolist(),
            "sigma_degrees": self.sigma_deg.tolist(),
        }


def cameras_of(found: SmoothedMap) -> list[MappedCamera]:
    """The cameras of a rig beside its first one, as the map has them."""
    cameras = found.problem.cameras
    layout = SharedLayout(cameras)
    mounted, first = layout.mounted(found.shared), cameras[0].name
    several = []
    for camera in range(1, len(cameras)):
        rows = layout.rig[camera]
        off = found.shared[rows]
        sigmas = np.sqrt(np.diag(found.shared_covariance[rows, rows]))
        T = from_parts(mounted.R[camera], mounted.t[camera])
        turned = np.rad2deg(off[3:]), np.rad2deg(sigmas[3:])
        several.append(
            MappedCamera(cameras[camera], first, T, off[:3], turned[0], sigmas[:3], turned[1])
        )
    return several


class CalibrationError(NamedTuple):
    """Errors of a camera's calibration: by how much the true one differs from the given one.

    Attributes:
        name: of the camera.
        given, off, sigma: (n,) fx, fy, cx, cy and the coefficients of distortion.
    """

    name: str
    given: Floats
    off: Floats
    sigma: Floats


def calibrations_of(found: SmoothedMap) -> list[CalibrationError]:
    """The errors of calibrations that are estimated."""
    cameras, several = found.problem.cameras, []
    for camera, rows in enumerate(SharedLayout(cameras).intrinsics):
        info = next((one.info for one in found.problem.sightings if one.camera == camera), None)
        known = cameras[camera].calibration
        if known is None or info is None:
            continue
        root = root_of(known, info)
        covariance = root @ found.shared_covariance[rows, rows] @ root.T
        given = np.concatenate([info.K[[0, 1, 0, 1], [0, 1, 2, 2]], info.D])
        off, sigma = root @ found.shared[rows], np.sqrt(np.maximum(np.diag(covariance), 0))
        several.append(CalibrationError(cameras[camera].name, given, off, sigma))
    return several


def _median(T: Floats) -> Floats:
    """(4, 4) median of poses (N, 4, 4): by each coordinate, near the one that most are close to."""
    back = np.swapaxes(T[:, :3, :3], 1, 2)
    apart = [
        np.median(np.linalg.norm(rotation_vectors(back @ one), axis=1)) for one in T[:, :3, :3]
    ]
    middle = T[int(np.argmin(apart)), :3, :3]
    off = np.median(rotation_vectors(middle.T @ T[:, :3, :3]), axis=0)
    return from_parts(middle @ turn(off), np.median(T[:, :3, 3], axis=0))


def _stamp(image: CameraImage) -> int:
    return image[1].header.stamp_ns
