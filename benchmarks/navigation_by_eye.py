"""Navigation with odometry by eye: `python benchmarks/navigation_by_eye.py`.

A quadrotor rests for two seconds and flies its default mission with a map of six surveyed tags
(standard deviations 1 mm and 0.06 degrees). In each flight the same detections go to navigators
with different odometry: that of the simulated robot, with and without the IMU, and that of the node
`visual_odometry`, alone and with the IMU once more. None has GPS. Poses are held against the true
ones without any alignment, once each is localized; NEES is of position and attitude (6 is honest);
*beyond* are poses with an error of x, y or z above 4 standard deviations.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from inertial_odometry import ERRORS, is_known, simulated

from ros_visualise.core.params import update
from ros_visualise.data import Image
from ros_visualise.estimation.landmark_map import MapMode
from ros_visualise.estimation.localization import map_file
from ros_visualise.estimation.localization.estimate import known
from ros_visualise.estimation.localization.track import Branch, LandmarkTrack
from ros_visualise.estimation.params import NavigatorParams
from ros_visualise.geometry import se3
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.geometry.trajectory_errors import nees, pose_error
from ros_visualise.graph.landmarks import tags_of_world
from ros_visualise.nodes.landmark_navigator import LandmarkNavigator
from ros_visualise.nodes.tag_detector import TagDetector, TagParams
from ros_visualise.nodes.visual_odometry import CameraMotionParams, VisualOdometryNode
from ros_visualise.simulation.model import build_world
from ros_visualise.simulation.profiles import Profile

TAGS = range(10, 16)
SURVEYED = np.eye(6) * 1e-6  # m^2 and rad^2
GIVEN, EYE = "given", "by eye"


class Case(NamedTuple):
    """A navigator: its odometry, and if it takes the IMU."""

    odometry: str
    imu: bool


CASES = (Case(GIVEN, True), Case(GIVEN, False), Case(EYE, False), Case(EYE, True))


class Flight:
    """One flight, and the poses (message, CPU s of the step) that each navigator publishes."""

    def __init__(self, profile: Profile, seed: int, seconds: float, surveyed: Path) -> None:
        self.settings, self._messages = simulated(profile, seed, seconds)
        clock_s, turn = ERRORS[profile]
        readout = self.settings.camera_readout
        tags = TagParams(tags=tags_of_world("field"), readout=readout)
        self._tags = tags, TagDetector(tags)
        motion = CameraMotionParams(camera_clock=clock_s, camera_turn=turn, readout=readout)
        self._eye = motion, VisualOdometryNode(motion)
        params = NavigatorParams(map=str(surveyed), mode=MapMode.FROZEN)
        self.params = {case: update(params, {"imu": case.imu}) for case in CASES}
        self.navigators = {case: LandmarkNavigator(one) for case, one in self.params.items()}
        self.frames, self.poses = FrameTree(), {case: list[Any]() for case in CASES}
        self.truth: list[Any] = []
        self.spent_s = dict.fromkeys(CASES, 0.0)

    def fly(self) -> None:
        waiting: list[Image] = []
        for _, name, message in self._messages:
            if name in ("tf", "tf_static"):
                self.frames.add(message, name == "tf_static")
            elif name == "truth":
                self.truth.append(message)
            elif name == "image":
                waiting.append(message)
            elif name == "odom":
                self._tell(GIVEN, odometry=message)
            elif name == "imu":
                self._tell("", imu=message)
                self._look(imu=message)
            while waiting and is_known(self.frames, waiting[0]):
                image = waiting.pop(0)
                params, detector = self._tags
                self._tell("", detections=detector.step(image, params)["detections"])
                self._look(image=image)

    def _look(self, **message: Any) -> None:
        params, node = self._eye
        found = node.step(params, **message, frames=self.frames) or {}
        if "odometry" in found:
            self._tell(EYE, odometry=found["odometry"])

    def _tell(self, by: str, **message: Any) -> None:
        """Give a message to the navigators that take it."""
        for case, navigator in self.navigators.items():
            if by not in ("", case.odometry):
                continue
            start_s = time.process_time()
            found = navigator.step(self.params[case], **message, frames=self.frames) or {}
            self.spent_s[case] += time.process_time() - start_s
            if "pose" in found:
                self.poses[case].append(found["pose"])


def survey(path: Path) -> None:
    """Write the map of the tags that the mission passes, which are the larger ones of the field."""
    tags = [one for one in build_world("field", pictures=False).landmarks if one.kind == "tag"]
    six = [one for one in tags if one.tag_id in TAGS]
    tracks = [
        LandmarkTrack(
            f"tag36h11_{one.tag_id}",
            number,
            True,
            (Branch(known(np.array(one.position_xyz), one.R_map_landmark, SURVEYED), 0.0),),
            0,
            size_xyz=np.array([one.size, one.size, 0]),
            sizes=9,
            seen=9,
        )
        for number, one in enumerate(six, 1)
    ]
    path.write_text(map_file.to_text("map", tracks, None))


def judged(flight: Flight, case: Case) -> tuple[float, ...]:
    """RMS of the position, worst, NEES, poses beyond, poses, longest time without one, CPU s."""
    stamps = np.array([one.header.stamp_ns for one in flight.truth])
    errors, normal, beyond, at = [], [], 0, []
    for pose in flight.poses[case]:
        after = int(np.searchsorted(stamps, pose.header.stamp_ns))
        if not 0 < after < len(stamps):
            continue
        a, b = flight.truth[after - 1], flight.truth[after]
        part = (pose.header.stamp_ns - stamps[after - 1]) / (stamps[after] - stamps[after - 1])
        ends = (se3.from_pose(one.position_xyz, one.quat_xyzw) for one in (a, b))
        true = se3.to_pose(se3.interpolate(*ends, part))
        error = pose_error(pose.position_xyz, pose.quat_xyzw, *true)
        errors.append(error)
        normal.append(nees(error, pose.covariance) or np.nan)
        beyond += bool((np.abs(error[:3]) > 4 * np.sqrt(np.diag(pose.covariance)[:3])).any())
        at.append(pose.header.stamp_ns / 1e9)
    if not errors:
        return (np.nan,) * 3 + (0, 0, np.nan, flight.spent_s[case])
    off = np.linalg.norm(np.array(errors)[:, :3], axis=1)
    apart = float(np.diff([*at, stamps[-1] / 1e9]).max())
    rms, most, normally = float(np.sqrt((off**2).mean())), float(off.max()), float(np.mean(normal))
    return rms, most, normally, beyond, len(at), apart, flight.spent_s[case]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--profile", nargs="*", default=["realistic", "hard"])
    parser.add_argument("--seeds", type=int, nargs="*", default=[0, 1, 2, 3, 4])
    parser.add_argument("--seconds", type=float, default=45.0, help="simulated (%(default)s)")
    args = parser.parse_args()
    print("| profile | seed | odometry | RMS, m | worst, m | NEES | beyond | longest without, s |")
    print("|---|---|---|---|---|---|---|---|")
    for name in args.profile:
        for seed in args.seeds:
            with tempfile.TemporaryDirectory() as folder:
                survey(surveyed := Path(folder) / "map.yaml")
                flight = Flight(Profile(name), seed, args.seconds, surveyed)
            flight.fly()
            for case in CASES:
                rms, most, normal, beyond, count, apart, _ = judged(flight, case)
                label = f"{case.odometry}{', IMU' if case.imu else ''}"
                print(
                    f"| {name} | {seed} | {label} | {rms:.3f} | {most:.2f} | {normal:.1f} "
                    f"| {beyond} of {count} | {apart:.1f} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
