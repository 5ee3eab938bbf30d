"""Flights over tags that are computed, not rendered: the truth, the odometry and the corners.

Corners are where a camera would see them, with the noise that tags of their size have, so that what
a filter makes of them can be outcome by laws of statistics, over many flights in little time.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from ros_visualise.data import (
    CameraInfo,
    Detection,
    Detections,
    Floats,
    Header,
    Hypothesis,
    Imu,
    NavSatFix,
)
from ros_visualise.geometry import rotations
from ros_visualise.geometry.rigid import Pose
from ros_visualise.landmarks.pose import PoseEstimate, corner_sigma, squares_poses
from ros_visualise.simulation.robots.quadrotor.settings import QuadrotorParams
from ros_visualise.simulation.sensors.gps import GpsSensor
from ros_visualise.simulation.sensors.imu import ImuSensor
from ros_visualise.simulation.sensors.odometry import VisualInertialOdometry

S = 1_000_000_000
INFO = CameraInfo(480, 640, K=np.array([[381.4, 0, 319.5], [0, 381.4, 239.5], [0, 0, 1]]))
DRIFT = QuadrotorParams(odom_scale=0.01, odom_noise=0.02, odom_yaw_noise=0.003)
"""An odometry that is wrong by one per cent of the way."""
T_BASE_CAMERA = np.array([[0.0, -1, 0, 0.1], [-1, 0, 0, 0.02], [0, 0, -1, -0.05], [0, 0, 0, 1]])
_SQUARE = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) / 2
_EDGE_PX = 4
IMU_HZ = 100
GPS_ORIGIN = DRIFT.gps_latitude, DRIFT.gps_longitude, DRIFT.gps_altitude


@dataclass(frozen=True, eq=False)
class Tag:
    """A tag in the map: T_map_tag (4, 4), and the side of its square in metres."""

    T: Floats
    side_m: float

    @property
    def corners(self) -> Floats:
        """(4, 3) in the map."""
        return _SQUARE * self.side_m @ self.T[:3, :3].T + self.T[:3, 3]


Tags = Mapping[int, Tag]


def lawn_mower(
    length_m: float = 500.0, row_m: float = 64.0, spacing_m: float = 8.0, height_m: float = 10.0
) -> list[tuple[float, float, float]]:
    """Turning points of rows, until the way is as long as that."""
    points, way, row = [(0.0, 0.0, height_m)], 0.0, 0
    while way < length_m:
        x = row_m if row % 2 == 0 else 0.0
        points.append((x, row * spacing_m, height_m))
        points.append((x, (row + 1) * spacing_m, height_m))
        way += row_m + spacing_m
        row += 1
    return points[:-1]


def _smoothed(values: Floats) -> Floats:
    """(N, k) by two running means over a second."""
    window = np.ones(IMU_HZ) / IMU_HZ
    ends = IMU_HZ - 1, IMU_HZ - 1
    columns = []
    for column in values.T:
        padded = np.pad(column, ends, mode="edge")
        columns.append(np.convolve(np.convolve(padded, window, "valid"), window, "valid"))
    return np.column_stack(columns)


def field_of_tags(random: np.random.Generator, width: float, depth: float, count: int) -> Tags:
    """Tags that lie on the ground, nearly level, spread evenly but not in rows."""
    columns = max(1, round(np.sqrt(count * width / depth)))
    rows = -(-count // columns)
    tags = {}
    for number in range(count):
        row, column = divmod(number, columns)
        x = (column + 0.5 + random.uniform(-0.3, 0.3)) * width / columns
        y = (row + 0.5 + random.uniform(-0.3, 0.3)) * depth / rows - 4
        rpy = [*random.normal(0, 0.05, 2), random.uniform(-np.pi, np.pi)]
        T = np.eye(4)
        T[:3, :3] = rotations.to_matrix(rotations.from_rpy(rpy))
        T[:3, 3] = x, y, random.uniform(0, 0.3)
        tags[number] = Tag(T, 0.6)
    return tags


@dataclass
class Flight:
    """A flight by turning points, and what is told on it.

    Attributes:
        T_map_odom: (4, 4) where the odometry begins.
        poses_of: so many sights of each tag have poses; later its corners alone count anyway.
        posts: (N, 3) feet of posts, which look all alike.
        times_s, places, attitudes: the truth, (N,), (N, 3) and (N, 4) as x, y, z, w.
    """

    tags: Tags
    points: Sequence[tuple[float, float, float]]
    seed: int = 0
    speed: float = 3.0
    odom_hz: int = 25
    images_hz: float = 5.0
    level_rad: float = 0.0
    drift: QuadrotorParams = DRIFT
    poses_of: int = 1_000_000
    posts: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    T_map_odom: Floats = field(init=False)

    def __post_init__(self) -> None:
        self.random = np.random.default_rng([self.seed, 7])
        self._seen: Counter[int] = Counter()
        self._fly()
        tilt = self.random.normal(0, self.level_rad, 2)
        start = np.eye(4)
        start[:3, :3] = rotations.to_matrix(rotations.from_rpy([*tilt, 0.0]))
        self.T_map_odom = start

    def _fly(self) -> None:
        """Round its corners, as it cannot stop at once; truth at the IMU's rate, and at odom's."""
        points = np.array(self.points)
        legs = np.linalg.norm(np.diff(points, axis=0), axis=1)
        ends = np.concatenate([[0], np.cumsum(legs)])
        along = np.arange(0, ends[-1], self.speed / IMU_HZ)
        straight = np.stack([np.interp(along, ends, points[:, axis]) for axis in range(3)], 1)
        self._times_s = np.arange(len(along)) / IMU_HZ
        wobble = np.sin(self._times_s[:, None] * [0.9, 1.3, 0.4] + [0, 1, 2])
        self._places = _smoothed(straight) + wobble * [0.3, 0.3, 0.4]
        ahead = np.gradient(self._places, axis=0)
        yaw = _smoothed(np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))[:, None])
        self._attitudes = rotations.from_rpy(np.column_stack([wobble[:, :2] * 0.06, yaw]))
        every = slice(None, None, round(IMU_HZ / self.odom_hz))
        self.times_s, self.places = self._times_s[every], self._places[every]
        self.attitudes = self._attitudes[every]

    def imu(self) -> list[Imu]:
        """What an IMU in the robot's middle measures, with biases and noise."""
        R = rotations.to_matrix(self._attitudes)
        turns = np.swapaxes(R[:-1], 1, 2) @ R[1:]
        rates = np.array([cv2.Rodrigues(turn)[0][:, 0] for turn in turns]) * IMU_HZ
        a = np.diff(self._places, n=2, axis=0) * IMU_HZ**2 + [0, 0, 9.80665]
        forces = np.einsum("nji,nj->ni", R[1:-1], a)
        sensor = ImuSensor(replace(self.drift, imu_rate=IMU_HZ), self.seed)
        stamps = (self._times_s * S).round().astype(int).tolist()
        level = (1.0, 0.0, 0.0, 0.0)
        middle = (rates[:-1] + rates[1:]) / 2
        motions = np.column_stack([middle, forces])
        return [
            sensor.measure(stamp, level, motion)
            for stamp, motion in zip(stamps[1:-1], motions, strict=True)
        ]

    def gps(self) -> list[NavSatFix]:
        """What a receiver in the robot's middle tells, once in a second."""
        sensor, every = GpsSensor(self.drift, self.seed), slice(None, None, IMU_HZ)
        stamps = (self._times_s[every] * S).round().astype(int).tolist()
        return [
            sensor.measure(stamp, place)
            for stamp, place in zip(stamps, self._places[every], strict=True)
        ]

    @property
    def way_m(self) -> float:
        """How long it is."""
        return float(np.linalg.norm(np.diff(self.places, axis=0), axis=1).sum())

    def true_pose(self, number: int) -> Floats:
        """T_map_base (4, 4), the truth at an odometry."""
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = rotations.to_matrix(self.attitudes[number]), self.places[number]
        return T

    def told(self) -> Iterator[tuple[int, int, Pose, Detections | None]]:
        """Number, stamp, T_odom_base as the odometry believes, and what the camera sees then."""
        back = np.linalg.inv(self.T_map_odom)
        R = rotations.to_matrix(self.attitudes)
        R_odom, p_odom = back[:3, :3] @ R, self.places @ back[:3, :3].T + back[:3, 3]
        quats = rotations.from_matrix(R_odom)
        wxyz = np.roll(quats, 1, axis=1).tolist()
        # it begins at zero, and with the heading that it has
        first = tuple(p_odom[0].tolist())
        odometry = VisualInertialOdometry(self.drift, self.seed, first, (1.0, 0.0, 0.0, 0.0))
        every = round(self.odom_hz / self.images_hz)
        zero = np.zeros(3)
        for number, stamp in enumerate((self.times_s * S).round().astype(int).tolist()):
            place = tuple(p_odom[number].tolist())
            found = odometry.advance(stamp, place, tuple(wxyz[number]), zero, zero)
            at = found.position_xyz + p_odom[0]
            pose = (*at.tolist(), *found.quat_xyzw.tolist())
            seen = self.see(number, stamp) if number % every == 0 else None
            yield number, stamp, pose, seen

    def see(self, number: int, stamp_ns: int) -> Detections:
        """What the camera sees."""
        T_camera = self.true_pose(number) @ T_BASE_CAMERA
        seen: list[tuple[int, Floats]] = []
        for id, tag in self.tags.items():
            local = (tag.corners - T_camera[:3, 3]) @ T_camera[:3, :3]
            if (local[:, 2] < 0.1).any():
                continue
            pixels = local @ INFO.K.T
            pixels = pixels[:, :2] / pixels[:, 2:]
            inside = (pixels > _EDGE_PX) & (pixels < [640 - _EDGE_PX, 480 - _EDGE_PX])
            if inside.all():
                pixels = pixels + corner_sigma(pixels) * self.random.standard_normal((4, 2))
                seen.append((id, pixels))
        found = (*self._detections(seen), *self._posts(T_camera))
        return Detections(found, Header(stamp_ns, "camera"), INFO)

    def _posts(self, T_camera: Floats) -> Iterator[Detection]:
        """Of each its direction, as a network finds it, to a pixel."""
        focal = INFO.K[0, 0]
        for local in (self.posts - T_camera[:3, 3]) @ T_camera[:3, :3]:
            if local[2] < 0.1:
                continue
            pixel = (INFO.K @ local)[:2] / local[2]
            if not ((pixel > _EDGE_PX) & (pixel < [640 - _EDGE_PX, 480 - _EDGE_PX])).all():
                continue
            ray = np.append(local[:2] / local[2] + self.random.normal(0, 1 / focal, 2), 1.0)
            ray /= np.linalg.norm(ray)
            along = np.multiply.outer(ray, ray)
            covariance = 1e6 * np.eye(6)
            covariance[:3, :3] = (np.eye(3) - along) / focal**2 + 1e6 * along
            level = np.array([0.0, 0, 0, 1])
            hypothesis = Hypothesis("post", 0.9, ray, level, covariance, 7)
            yield Detection(pixel, np.full(2, 20.0), 0.0, (hypothesis,))

    def _detections(self, seen: list[tuple[int, Floats]]) -> Iterator[Detection]:
        if not seen:
            return
        corners = np.array([one for _, one in seen])
        sides = [self.tags[id].side_m for id, _ in seen]
        posed = [n for n, (id, _) in enumerate(seen) if self._seen[id] < self.poses_of]
        self._seen.update(id for id, _ in seen)
        poses: list[tuple[PoseEstimate, ...]] = [()] * len(seen)
        if posed:
            sigmas = corner_sigma(corners[posed])
            found = squares_poses(corners[posed], [sides[n] for n in posed], INFO, sigmas)
            for n, several in zip(posed, found, strict=True):
                poses[n] = several
        for (id, pixels), side, several in zip(seen, sides, poses, strict=True):
            hypotheses = tuple(
                Hypothesis(
                    f"tag36h11_{id}",
                    one.probability,
                    one.position_xyz,
                    one.quat_xyzw,
                    one.covariance,
                    id,
                )
                for one in several
            )
            if not hypotheses:
                hypotheses = (Hypothesis(f"tag36h11_{id}", 1.0, number=id),)
            yield Detection(
                pixels.mean(axis=0),
                np.ptp(pixels, axis=0),
                0.0,
                hypotheses,
                str(id),
                pixels,
                side_m=side,
            )
