"""A world for the navigator's tests: truth, sensors and their faults, by formulas of its own.

It shares nothing with the package but the classes of the messages, so that nothing is judged by
its own assumptions. Times are true seconds; frames as in REP 105. The odometry begins at its
identity, at the robot's first position and heading.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache, partial
from typing import Any, NamedTuple

import numpy as np

from ros_visualise.data import (
    CameraInfo,
    Detection,
    Detections,
    FluidPressure,
    Header,
    Hypothesis,
    Imu,
    MagneticField,
    NavSatFix,
    Odometry,
    Transforms,
    TransformStamped,
)

S = 1_000_000_000
T0 = 10_000  # stamp of time 0, seconds
UP = np.array([0.0, 0.0, 9.80665])
FOCAL, WIDTH, HEIGHT = 500.0, 640, 480
INFO = CameraInfo(
    HEIGHT, WIDTH, K=np.array([[FOCAL, 0, WIDTH / 2], [0, FOCAL, HEIGHT / 2], [0, 0, 1]])
)
CORNERS = np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]])
ORIGIN = 49.0, 8.4, 100.0  # latitude, longitude, altitude of the map's origin
DOWN = np.array([[0.0, -1, 0], [-1, 0, 0], [0, 0, -1]])  # a camera whose image's top is ahead
VAGUE = 1e6


def skew(v):
    x, y, z = v
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def exp(w):
    """The rotation (3, 3) by a vector (3,), by Rodrigues' formula."""
    angle = np.linalg.norm(w)
    if angle < 1e-12:
        return np.eye(3) + skew(w)
    K = skew(w / angle)
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def log(R):
    """The vector (3,) of a rotation (3, 3) by less than half a turn."""
    cosine = np.clip((np.trace(R) - 1) / 2, -1, 1)
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
    sine = np.linalg.norm(axis)
    return axis if sine < 1e-12 else axis * (np.arctan2(sine, cosine) / sine)


def from_rpy(roll, pitch, yaw):
    return exp([0, 0, yaw]) @ exp([0, pitch, 0]) @ exp([roll, 0, 0])


def quat_of(R):
    """x, y, z, w: the eigenvector of the largest eigenvalue of Bar-Itzhack's matrix."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = R
    K = np.array(
        [
            [xx - yy - zz, yx + xy, zx + xz, zy - yz],
            [yx + xy, yy - xx - zz, zy + yz, xz - zx],
            [zx + xz, zy + yz, zz - xx - yy, yx - xy],
            [zy - yz, xz - zx, yx - xy, xx + yy + zz],
        ]
    )
    return np.linalg.eigh(K / 3)[1][:, -1]


def matrix_of(quat):
    x, y, z, w = np.asarray(quat) / np.linalg.norm(quat)
    return np.eye(3) + 2 * w * skew([x, y, z]) + 2 * skew([x, y, z]) @ skew([x, y, z])


class Pose(NamedTuple):
    """T_map_body."""

    R: Any
    p: Any

    def __matmul__(self, other):
        return Pose(self.R @ other.R, self.R @ other.p + self.p)

    @property
    def inverse(self):
        return Pose(self.R.T, -self.R.T @ self.p)


HERE = Pose(np.eye(3), np.zeros(3))
CAMERA = Pose(DOWN, np.array([0.2, 0.05, -0.1]))
IMU = Pose(exp([0.1, -0.2, 0.3]), np.array([0.05, -0.1, 0.08]))
BELOW = Pose(np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]), np.zeros(3))  # its x axis is down
ANTENNA = Pose(np.eye(3), np.array([-0.6, 0.3, 0.5]))


def along(*points, speed=3.0):
    """A way through points (3,) at a speed: from rest, with round corners and a little swinging.

    Straight lines smoothed by two running means of a second: twice differentiable.
    """
    return _along(tuple(tuple(map(float, point)) for point in points), float(speed))


@lru_cache(8)
def _along(points, speed):
    points = np.array(points, float)
    legs = np.linalg.norm(np.diff(points, axis=0), axis=1)
    knots = np.concatenate([[0], legs.cumsum()[:-1]])
    slopes = np.diff(points, axis=0) / legs[:, None]
    kinks = np.diff(slopes, axis=0, prepend=0)

    def twice_integrated(s):
        """The second antiderivative of the way as a function of its length."""
        after = np.maximum(s - knots, 0)
        after[0] = s
        return points[0] * s**2 / 2 + after**3 @ kinks / 6

    def place(s):
        several = [twice_integrated(one) for one in (s - speed, s, s + speed)]
        return (several[0] - 2 * several[1] + several[2]) / speed**2

    @lru_cache(100_000)  # of all sensors, and of all worlds on this way
    def pose(t):
        s = speed * (max(t, 0) ** 2 / 4 if t < 2 else t - 1)
        ahead = place(s + 0.2) - place(s - 0.2)
        swing = 0.05 * (1 - np.exp(-((max(t, 0) / 3) ** 3)))
        roll, pitch = swing * np.sin(0.9 * t), swing * np.sin(1.3 * t + 1)
        made = Pose(from_rpy(roll, pitch, np.arctan2(ahead[1], ahead[0])), place(s))
        for part in made:
            part.setflags(write=False)
        return made

    return pose


def square(side=12.0, height=0.0, laps=3, turned=0.0):
    """Points of laps round a square, the first to (side, 0) before it is turned by an angle."""
    lap = np.array([[0, 0, 0], [side, 0, 0], [side, side, 0], [0, side, 0]], float)
    return np.concatenate([lap] * laps) @ exp([0, 0, turned]).T + np.array([0, 0, height])


def tags_on_ground(places, side=0.5, seed=1):
    """Nearly level tags at (x, y, z), by name, with headings of all kinds."""
    random = np.random.default_rng(seed)
    return {
        f"tag36h11_{n}": Tag(
            Pose(from_rpy(*random.normal(0, 0.05, 2), random.uniform(-3, 3)), np.array(at, float)),
            side,
        )
        for n, at in enumerate(places)
    }


class Tag(NamedTuple):
    pose: Pose
    side: float

    @property
    def corners(self):
        return CORNERS * self.side @ self.pose.R.T + self.pose.p


@dataclass
class Sensor:
    """When a sensor measures, and when its messages come.

    Attributes:
        latency_s, jitter_s: least time until a message comes, and the most that is added to it.
        clock_s: its clock minus the true time.
        spans: times within which it works; none are all.
        stamps_s: what is added to the stamp of the n-th message, by n.
        priority: order of messages that come at the same time.
    """

    hz: float
    latency_s: float = 0.0
    jitter_s: float = 0.0
    clock_s: float = 0.0
    spans: Sequence[tuple[float, float]] = ()
    stamps_s: dict[int, float] = field(default_factory=dict)
    priority: int = 0

    def times(self, until_s):
        times = np.arange(0, until_s + 1e-9, 1 / self.hz)
        if self.spans:
            times = [t for t in times if any(a <= t < b for a, b in self.spans)]
        return list(times)


class Event(NamedTuple):
    """A message, when it comes, and what it is called by `LandmarkNavigator.step`."""

    arrival_s: float
    priority: int
    port: str
    message: Any


@dataclass
class World:
    """A robot on its way, and what its sensors measure.

    Attributes:
        path: (time) -> T_map_base.
        slips: (from, to, factor): the odometry measures this part of its motion.
        slides: (from, to, (3,)): the odometry moves by so much more, in the map's axes.
        frozen: (from, to): the odometry repeats its pose and then goes on where the robot is.
        scales: (from, to, scale error of distances); otherwise ``scale``.
        turn_scale: scale error of rotations.
        walk, heading, tilt: odometry noise, m/sqrt(m) and rad/sqrt(m).
        kidnapped: (time, (3,)): the robot is moved, and no sensor notices.
        imu_turned: (from, to, (3, 3)): the IMU's axes are others.
        shakes_rad: the camera's attitude differs from its frame, anew in each image.
        mounted_rad: (3,) the same, in all images.
        gimbal: keeps the camera level, its angles on tf ``gimbal_age_s`` old; None: it is fixed.
        pixel: standard deviation of corners, as their detector states.
        clutter: part of the images that has a false tag, each with a name of its own.
        size_factor: true sizes of tags are multiplied by it in detections.
        size_factors: the same of some tags, by name.
        posts: (N, 3) feet of posts, all alike.
        gps_sigma, gps_slow, gps_time: deviation, its slow part of the variance, time constant.
    """

    path: Callable[[float], Pose]
    tags: dict[str, Tag] = field(default_factory=dict)
    seed: int = 0
    odometry: Sensor = field(default_factory=lambda: Sensor(10))
    images: Sensor = field(default_factory=lambda: Sensor(5, priority=1))
    imu: Sensor | None = None
    gps: Sensor | None = None
    barometer: Sensor | None = None
    magnetometer: Sensor | None = None
    slips: Sequence[tuple[float, float, float]] = ()
    slides: Sequence[tuple[float, float, Any]] = ()
    frozen: Sequence[tuple[float, float]] = ()
    scales: Sequence[tuple[float, float, float]] = ()
    scale: float | None = None
    turn_scale: float = 0.0
    walk: float = 0.02
    heading: float = np.radians(0.2)
    tilt: float = np.radians(0.02)
    states_covariance: bool = False
    kidnapped: tuple[float, Any] | None = None
    imu_turned: Sequence[tuple[float, float, Any]] = ()
    shakes_rad: float = 0.0
    mounted_rad: Any = (0.0, 0.0, 0.0)
    gimbal: Sensor | None = None
    gimbal_age_s: float = 0.0
    gyro: float = 3e-4
    accel: float = 3e-3
    pixel: float = 0.3
    clutter: float = 0.0
    size_factor: float = 1.0
    size_factors: dict[str, float] = field(default_factory=dict)
    range_m: float = 20.0
    posts: Any = ()
    gps_sigma: float = 1.0
    gps_slow: float = 0.5
    gps_time: float = 60.0
    gps_states: bool = True

    def truth(self, t):
        """T_map_base."""
        R, p = self.path(t)
        if self.kidnapped and t >= self.kidnapped[0]:
            p = p + self.kidnapped[1]
        return Pose(R, p)

    def start(self):
        """T_map_odom at the start: level."""
        R, p = self.path(0.0)
        return Pose(exp([0, 0, np.arctan2(R[1, 0], R[0, 0])]), p)

    def events(self, until_s):
        """All messages, in the order in which they come."""
        makers = {
            "odometry": (self.odometry, self._odometry),
            "detections": (self.images, self._images),
            "imu": (self.imu, self._imu),
            "gps": (self.gps, self._gps),
            "barometer": (self.barometer, self._barometer),
            "magnetometer": (self.magnetometer, self._magnetometer),
            "tf": (self.gimbal, self._gimbal),
        }
        several = []
        for number, (port, (sensor, maker)) in enumerate(makers.items()):
            if sensor is None:
                continue
            random = np.random.default_rng([self.seed, number])
            lates = np.random.default_rng([self.seed, number, 1])
            times = sensor.times(until_s)
            for n, (t, make) in enumerate(zip(times, maker(times, random), strict=True)):
                stamp = t + sensor.clock_s + sensor.stamps_s.get(n, 0.0)
                arrival = t + sensor.latency_s + sensor.jitter_s * lates.random()
                message = make(round((stamp + T0) * S))
                several.append(Event(arrival, sensor.priority, port, message))
        return sorted(several, key=lambda one: one[:2])

    def _odometry(self, times, random):
        scale = random.normal(0, 0.01) if self.scale is None else self.scale
        back = self.start().inverse
        believed, slid, before = HERE, np.zeros(3), None
        variance, way = np.zeros(6), 0.0
        repeated = None
        for t in times:
            now = self.path(t)
            told = np.zeros((6, 6))
            step_s = 0.0
            if before is not None:
                step_s = t - before[0]
                D = before[1].inverse @ now
                metres = float(np.linalg.norm(D.p))
                middle = (t + before[0]) / 2
                factor = 1 + _at(self.scales, middle, scale)
                if _at(self.slips, middle, 1.0) < 1:
                    part = _at(self.slips, middle, 1.0)
                    D = Pose(exp(part * log(D.R)), part * D.p)
                still = 1e-3 * np.sqrt(step_s)
                noise = (self.walk * np.sqrt(metres) + still) * random.normal(size=3)
                sigmas = np.array([self.tilt, self.tilt, self.heading]) * np.sqrt(metres)
                turn = exp(believed.R.T @ (sigmas * random.normal(size=3)))
                turned = exp((1 + self.turn_scale) * log(D.R)) @ turn
                believed = believed @ Pose(turned, factor * D.p + noise)
                step = np.concatenate([np.full(3, self.walk**2), sigmas**2 / (metres + 1e-9)])
                told = np.diag(step * metres / step_s**2 + 1e-6)
                way += metres
                variance[:3] = self.walk**2 * way + (self.heading**2 * way**3 / 3)
                variance[3:] = np.array([self.tilt, self.tilt, self.heading]) ** 2 * way
                for a, b, v in self.slides:
                    part = np.clip((t - a) / max(b - a, 1e-9), 0, 1)
                    part -= np.clip((before[0] - a) / max(b - a, 1e-9), 0, 1)
                    slid = slid + part * (back.R @ np.asarray(v, float))
            before = t, now
            shown = believed
            if any(a <= t < b for a, b in self.frozen):
                shown = repeated = repeated or believed
            else:
                repeated = None
            covariances = {}
            if self.states_covariance:
                covariances = {
                    "pose_covariance": np.diag(variance + 1e-6),
                    "twist_covariance": told + 1e-9 * np.eye(6),
                }
            h = 0.01
            v = self.path(t).R.T @ (self.path(t + h).p - self.path(t - h).p) / (2 * h)
            w = log(self.path(t - h).R.T @ self.path(t + h).R) / (2 * h)
            yield lambda ns, T=shown, d=slid, v=v, w=w, c=covariances: Odometry(
                T.p + d,
                quat_of(T.R),
                v,
                w,
                **c,
                child_frame_id="base_link",
                header=_header(ns, "odom"),
            )

    def _imu(self, times, random):
        h = 0.005
        biases = random.normal(0, 0.003, 3), random.normal(0, 0.03, 3)
        scale = np.sqrt(self.imu.hz)
        for t in times:
            a, b, c = (self.path(t + d) @ IMU for d in (-h, 0, h))
            w = log(a.R.T @ c.R) / (2 * h)
            f = b.R.T @ ((a.p - 2 * b.p + c.p) / h**2 + UP)
            w = w + biases[0] + self.gyro * scale * random.normal(size=3)
            f = f + biases[1] + self.accel * scale * random.normal(size=3)
            turned = _at(self.imu_turned, t, np.eye(3))
            yield (
                lambda ns, w=turned @ w, f=turned @ f: Imu(
                    np.array([0.0, 0, 0, 1]), w, f, header=_header(ns, "imu_link")
                )
            )

    def _gps(self, times, random):
        sigmas = self.gps_sigma * np.array([1, 1, 2])
        slow, before = random.normal(size=3), None
        for t in times:
            if before is not None:
                keep = np.exp(-(t - before) / self.gps_time)
                slow = keep * slow + np.sqrt(1 - keep**2) * random.normal(size=3)
            before = t
            white = np.sqrt(1 - self.gps_slow) * random.normal(size=3)
            enu = (self.truth(t) @ ANTENNA).p + sigmas * (np.sqrt(self.gps_slow) * slow + white)
            covariance = np.diag(sigmas**2) if self.gps_states else np.zeros((3, 3))
            at = geodetic(enu)
            yield lambda ns, at=at, c=covariance: NavSatFix(
                *at, c, 2 if self.gps_states else 0, header=_header(ns, "gps_link")
            )

    def _barometer(self, times, random):
        """The pressure of the standard atmosphere."""
        for t in times:
            height = ORIGIN[2] + self.truth(t).p[2] + 0.2 * random.normal()
            pressure = 101325 * (1 - 2.25577e-5 * height) ** 5.25588
            yield lambda ns, pa=pressure: FluidPressure(pa, header=_header(ns, "base_link"))

    def _magnetometer(self, times, random):
        """A field that dips by 65 degrees."""
        field_xyz = 48e-6 * np.array([0, np.cos(1.13), -np.sin(1.13)])
        for t in times:
            seen = self.truth(t).R.T @ field_xyz + 3e-7 * random.normal(size=3)
            yield lambda ns, seen=seen: MagneticField(seen, header=_header(ns, "base_link"))

    def _images(self, times, random):
        for t in times:
            shaken = exp(self.mounted_rad) @ exp(self.shakes_rad * random.normal(size=3))
            mount = self._level(t) if self.gimbal else CAMERA
            camera = self.truth(t) @ mount @ Pose(shaken, np.zeros(3))
            header = partial(_header, frame_id="gimbal" if self.gimbal else "camera")
            seen = [
                one
                for name, tag in self.tags.items()
                if (one := self._see(name, tag, camera, random))
            ]
            if random.random() < self.clutter:
                seen.append(self._false(f"tag36h11_{random.integers(1000, 10**9)}", random))
            seen += self._see_posts(camera, random)
            yield lambda ns, seen=tuple(seen), at=header: Detections(seen, at(ns), INFO)

    def _gimbal(self, times, random):
        for t in times:
            pose = self._level(t - self.gimbal_age_s)
            yield lambda ns, pose=pose: frame("base_link", "gimbal", pose, ns)

    def _level(self, t):
        """T_body_camera of a level camera."""
        R = self.path(t).R
        return Pose(R.T @ exp([0, 0, np.arctan2(R[1, 0], R[0, 0])]) @ CAMERA.R, CAMERA.p)

    def _see(self, name, tag, camera, random):
        local = (tag.corners - camera.p) @ camera.R
        facing = tag.pose.R[:, 2] @ (camera.p - tag.pose.p)
        if local[:, 2].min() < 0.2 or local[:, 2].max() > self.range_m or facing <= 0.1:
            return None
        pixels = project(local)
        if (pixels < 3).any() or (pixels > [WIDTH - 4, HEIGHT - 4]).any():
            return None
        pixels = pixels + self.pixel * random.normal(size=(4, 2))
        factor = self.size_factors.get(name, self.size_factor)
        side, pose = tag.side * factor, camera.inverse @ tag.pose
        return tag_detection(name, pixels, side, pose, self.pixel, factor)

    def _false(self, name, random):
        at = np.append(random.uniform([-2, -1.5], [2, 1.5]), 5.0)
        pose = Pose(from_rpy(np.pi + random.normal(0, 0.3), random.normal(0, 0.3), 0), at)
        pixels = project(CORNERS * 0.5 @ pose.R.T + at) + self.pixel * random.normal(size=(4, 2))
        return tag_detection(name, pixels, 0.5, pose, self.pixel)

    def _see_posts(self, camera, random):
        """The direction of each, as a network finds it, to a pixel."""
        for local in [(np.asarray(at) - camera.p) @ camera.R for at in self.posts]:
            if local[2] < 0.2 or np.linalg.norm(local) > self.range_m:
                continue
            pixel = project(local)
            if (pixel < 3).any() or (pixel > [WIDTH - 4, HEIGHT - 4]).any():
                continue
            ray = np.append((local[:2] / local[2]) + random.normal(0, 1 / FOCAL, 2), 1.0)
            ray /= np.linalg.norm(ray)
            away = np.outer(ray, ray)
            covariance = VAGUE * np.eye(6)
            covariance[:3, :3] = (np.eye(3) - away) / FOCAL**2 + VAGUE * away
            one = Hypothesis("post", 0.9, ray, np.array([0.0, 0, 0, 1]), covariance, 7)
            yield Detection(pixel, np.full(2, 20.0), 0.0, (one,))


def _header(ns, frame_id):
    return Header(ns, frame_id)


def _at(spans, t, otherwise):
    """The value of the span (from, to, value) that a time is in."""
    return next((value for a, b, value in spans if a <= t < b), otherwise)


def project(local):
    return FOCAL * local[..., :2] / local[..., 2:] + [WIDTH / 2, HEIGHT / 2]


def tag_detection(name, pixels, side, pose, pixel, factor=1.0):
    """A tag by its corners, and its pose by Gauss and Newton from the true one."""
    R, t = pose.R, pose.p * factor
    for _ in range(2):
        arms = CORNERS * side @ R.T
        local = arms + t
        by_point = np.zeros((4, 2, 3))
        by_point[:, 0, 0] = by_point[:, 1, 1] = FOCAL / local[:, 2]
        by_point[..., 2] = -FOCAL * local[:, :2] / local[:, 2:] ** 2
        by_turn = -by_point @ np.array([skew(arm) for arm in arms])
        J8 = np.concatenate([by_point, by_turn], axis=-1).reshape(8, 6)
        step = np.linalg.lstsq(J8, (pixels - project(local)).ravel(), rcond=None)[0]
        R, t = exp(step[3:]) @ R, t + step[:3]
    covariance = np.linalg.inv(J8.T @ J8) * pixel**2
    digits = name.rpartition("_")[2]
    one = Hypothesis(name, 1.0, t, quat_of(R), covariance, int(digits))
    size, noise = np.ptp(pixels, axis=0), pixel**2 * np.eye(8)
    return Detection(
        pixels.mean(axis=0),
        size,
        0.0,
        (one,),
        digits,
        pixels,
        side_m=side,
        corners_covariance=noise,
    )


def geodetic(enu):
    """Latitude, longitude and altitude near `ORIGIN`, by the ellipsoid's radii of curvature."""
    a, f = 6378137.0, 1 / 298.257223563
    e2, latitude = f * (2 - f), np.radians(ORIGIN[0])
    root = np.sqrt(1 - e2 * np.sin(latitude) ** 2)
    M, N = a * (1 - e2) / root**3, a / root
    east, north, up = enu
    new = latitude + north / (M + ORIGIN[2]) - east**2 * np.tan(latitude) / (2 * M * N)
    longitude = ORIGIN[1] + np.degrees(east / ((N + ORIGIN[2]) * np.cos(latitude + north / M)))
    return np.degrees(new), longitude, ORIGIN[2] + up + (east**2 / N + north**2 / M) / 2


def frame(parent, child, pose, ns=0):
    return TransformStamped(child, pose.p, quat_of(pose.R), Header(ns, parent))


def mounting():
    """The static transforms of the sensors."""
    poses = {"camera": CAMERA, "imu_link": IMU, "gps_link": ANTENNA, "below": BELOW}
    return Transforms(tuple(frame("base_link", name, pose) for name, pose in poses.items()))


def map_text(tags, covariance, common=None):
    """A map file; ``covariance`` (6, 6) of each tag, the common one included."""
    lines = ["frame_id: map"]
    lines += [f"common_covariance: {np.ravel(common).tolist()}"] if common is not None else []
    lines.append("landmarks:")
    for name, tag in tags.items():
        lines += [
            f"- name: {name}",
            f"  class: {name}",
            f"  number: {name.rpartition('_')[2]}",
            f"  size: [{tag.side}, {tag.side}, 0.0]",
            "  seen: 20",
            "  pose:",
            f"    position: {tag.pose.p.tolist()}",
            f"    orientation: {quat_of(tag.pose.R).tolist()}",
            f"    covariance: {np.ravel(covariance).tolist()}",
        ]
    return "\n".join(lines) + "\n"


def surveyed(tags, sigma_m, sigma_rad, seed):
    """Tags as a survey with these errors measured them, and the covariance (6, 6) of each."""
    random = np.random.default_rng([seed, 99])
    found = {}
    for name, tag in tags.items():
        R = exp(random.normal(0, sigma_rad, 3)) @ tag.pose.R
        found[name] = Tag(Pose(R, tag.pose.p + random.normal(0, sigma_m, 3)), tag.side)
    return found, np.diag([sigma_m**2] * 3 + [sigma_rad**2] * 3)
