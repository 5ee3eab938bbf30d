"""Accuracy of visual landing of the simulated quadrotor on its pad.

    python benchmarks/landmarks/landing.py [--seeds 50] [--first 0] [--case line] [--projected]

Each landing is flown with the whole chain: the camera's images are rendered, `tag_detector` looks
for tags in them, `landing_target` follows the pad, and the quadrotor takes what that says. With
`--projected`, which takes a tenth of the time, corners of tags are projected by the truth instead,
with the noise that the detector was measured to have. On the pad of the case `helipad` there are no
tags: there `landmark_detector` looks for it in rendered images, by our own network. What is
measured is where the middle of the quadrotor is from the middle of the pad when its motors go off,
by the truth.
"""

from __future__ import annotations

import argparse
import cmath
import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ros_visualise.data import Detections, Header, Odometry
from ros_visualise.geometry import rigid
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.graph.landmarks import tags_of_world
from ros_visualise.landmarks.pose import corner_sigma
from ros_visualise.landmarks.tags import Tag
from ros_visualise.landmarks.tags.known import read_known_tags
from ros_visualise.landmarks.tags.locating import locate
from ros_visualise.nodes.landing_target import LandingTarget, LandingTargetParams
from ros_visualise.nodes.landmark_detector import LandmarkDetector, LandmarkParams
from ros_visualise.nodes.tag_detector import TagDetector, TagParams
from ros_visualise.simulation.missions import Mission
from ros_visualise.simulation.pad import PadMotion, meets_start
from ros_visualise.simulation.robots.quadrotor.settings import QuadrotorParams
from ros_visualise.simulation.sensors.camera import calibrate
from ros_visualise.simulation.simulator import Simulation

WORLD = "plane"
CASES: dict[str, dict[str, Any]] = {
    "calm": {},
    "gusts": {"wind": 6.0},
    "line": {"wind": 6.0, "pad_motion": PadMotion.LINE, "pad_reach": 60.0},
    "helipad": {"wind": 4.0, "pad_tags": False},
    "circle": {"wind": 6.0, "pad_motion": PadMotion.CIRCLE, "pad_reach": 8.0},
}
"""Wind with its gusts in all but the first; the pad moves at 1 m/s in two of them."""
HELIPAD = LandingTargetParams(
    target="helipad", speed=0.0, timeout=10.0, ground_height=0.16, ground_sigma=0.05
)
"""A helipad that stands still, 0.16 m above the frame of the odometry, which is where `base_link`
was at the start; it is larger than the image long before the quadrotor is there."""
UNHEARD: dict[str, Any] = {"gps": False, "imu_rate": 1.0, "mag_rate": 1.0, "baro_rate": 1.0}
"""Sensors that nobody here listens to."""
_AHEAD_M = 10.0  # that a pad on a line goes until the quadrotor is there
_LONGEST_S = 90
_IMAGE_NS = 100_000_000
_SMALLEST_PX = 20  # a tag whose side is smaller is not found


@dataclass
class Landing:
    """One landing: how far off in metres, and how long it took."""

    seed: int
    off_m: float
    seconds: float
    failure: str


class Chain:
    """The nodes between the camera and the quadrotor, one after the other."""

    def __init__(self, settings: QuadrotorParams, seed: int, rendered: bool) -> None:
        self._tags = TagParams(tags=tags_of_world(WORLD), corner_floor=0.0)
        self._params = LandingTargetParams() if settings.pad_tags else HELIPAD
        self._objects = LandmarkParams(classes="helipad")
        self._network = None if settings.pad_tags else LandmarkDetector(self._objects)
        self._detector, self._target = TagDetector(self._tags), LandingTarget(self._params)
        self._frames = FrameTree()
        self._eye = None if rendered else Eye(settings, seed, self._frames)

    def take(self, name: str, message: Any) -> Odometry | None:
        """What the quadrotor is told on a message of its sensors, if anything."""
        found = None
        if name in ("tf", "tf_static"):
            self._frames.add(message, static=name == "tf_static")
        elif name == "odom":
            found = self._target.step(self._params, odom=message, frames=self._frames)
        elif name == "image" and self._network is not None:
            things = self._network.step(message, self._objects)["detections"]
            found = self._target.step(self._params, objects=things, frames=self._frames)
        elif name == "image":
            seen = self._detector.step(message, self._tags)["detections"]
            found = self._target.step(self._params, seen, frames=self._frames)
        elif self._eye is not None and name == "truth":
            self._eye.truth = message
        elif self._eye is not None and name == "pad" and not message.header.stamp_ns % _IMAGE_NS:
            found = self._target.step(self._params, self._eye.look(message), frames=self._frames)
        return found["landing_target_odom"] if found else None


class Eye:
    """Finds the pad's tags by the truth, with the noise that a detector has."""

    def __init__(self, settings: QuadrotorParams, seed: int, frames: FrameTree) -> None:
        self._info, self._known = calibrate(settings), read_known_tags(tags_of_world(WORLD))
        self._random, self._frames = np.random.default_rng(seed), frames
        self.truth: Odometry | None = None

    def look(self, pad: Odometry) -> Detections:
        """What is in the image of that time."""
        stamp_ns = pad.header.stamp_ns
        T_base_camera = self._frames.lookup("base_link", "camera_optical", stamp_ns)
        T_camera_pad = np.linalg.inv(_matrix(self.truth) @ T_base_camera) @ _matrix(pad)
        tags = []
        for number, corners in self._known.bundles[0].corners_xyz.items():
            seen = corners @ T_camera_pad[:3, :3].T + T_camera_pad[:3, 3]
            if seen[:, 2].min() < 0.05:
                continue
            uv = (seen @ self._info.K.T)[:, :2] / seen[:, 2:]
            rim = (uv - uv.mean(axis=0)) * 1.25 + uv.mean(axis=0)
            within = (rim > 0) & (rim < [self._info.width - 1, self._info.height - 1])
            if within.all() and np.linalg.norm(np.roll(uv, 1, 0) - uv, axis=1).min() > _SMALLEST_PX:
                noise = corner_sigma(uv[None])[0] * self._random.standard_normal((4, 2))
                tags.append(Tag("tag36h11", number, uv + noise, 0, 100.0))
        found = locate(tags, self._known, 0.0, self._info)
        return Detections(found, Header(stamp_ns, "camera_optical"), self._info)


def plan(seed: int, settings: QuadrotorParams) -> tuple[QuadrotorParams, Mission]:
    """Where the pad goes, and a mission that leads to about where it is then, 6 m above it."""
    random = np.random.default_rng(seed)
    wind, heading = random.uniform(0, 360), random.uniform(-math.pi, math.pi)
    x, y = random.uniform(-4.5, -2.5), random.uniform(0.5, 2.5)
    off_x, off_y = random.uniform(-1.5, 1.5, 2)
    back = {PadMotion.LINE: _AHEAD_M + 0j, PadMotion.CIRCLE: settings.pad_reach / 2 * 1j}
    away = back.get(settings.pad_motion, 0j) * cmath.rect(1, heading)
    over = x + off_x, y + off_y, 6.0
    mission = Mission(waypoints=(over,), land_on="pad", height=6.0, speed=2.0)

    def headed(heading: float, away: complex) -> QuadrotorParams:
        at = {"pad_x": x - away.real, "pad_y": y - away.imag, "pad_heading": math.degrees(heading)}
        return replace(settings, wind_direction=wind, **at)

    planned = headed(heading, away)
    return headed(heading + math.pi, -away) if meets_start(planned) else planned, mission


def land(seed: int, settings: QuadrotorParams, rendered: bool) -> Landing:
    """Fly one landing."""
    settings, mission = plan(seed, settings)
    simulation = Simulation(
        "quadrotor", WORLD, seed, mission, settings, lambda output: rendered or output != "image"
    )
    chain, place = Chain(settings, seed, rendered), {}
    run = simulation.run()
    for stamp_ns, name, message in run:
        place[name] = message
        told = chain.take(name, message)
        if told is not None:
            simulation.see(told)
        if name == "pad" and (simulation.finished or stamp_ns > _LONGEST_S * 1e9):
            break
    run.close()
    apart = place["truth"].position_xyz - place["pad"].position_xyz
    failure = simulation.failure or ("" if simulation.finished else "it did not land")
    return Landing(seed, math.hypot(*apart[:2]), stamp_ns / 1e9, failure)


def _matrix(odometry: Odometry) -> np.ndarray:
    return rigid.to_matrix(rigid.pose(odometry.position_xyz, odometry.quat_xyzw))


def main() -> None:
    """Fly all landings of each case, and tell of each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--case", choices=CASES, action="append")
    parser.add_argument("--projected", action="store_true", help="do not render")
    args = parser.parse_args()
    for case in args.case or CASES:
        rendered = not args.projected or case == "helipad"
        settings = replace(QuadrotorParams(), **UNHEARD, **CASES[case])
        off = []
        for seed in range(args.first, args.first + args.seeds):
            landing = land(seed, settings, rendered)
            print(case, landing, flush=True)
            off.append(math.inf if landing.failure else landing.off_m)
        print(
            f"{case}: {len(off)} landings, {sum(m <= 0.15 for m in off)} within 0.15 m, "
            f"{sum(m > 0.3 for m in off)} beyond 0.3 m or failed, "
            f"median {np.median(off):.3f} m, largest {max(off):.3f} m"
        )


if __name__ == "__main__":
    main()
