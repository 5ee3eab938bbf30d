"""Visual-inertial odometry of simulated flights: `python benchmarks/inertial_odometry.py`.

A quadrotor with a camera on a gimbal and an IMU rests for two seconds and flies its default
mission; images and IMU go through the code of the node `visual_odometry`. Its poses are held
against the true ones, aligned at the first: drift is the error at the end as a part of the way;
NEES is of position and attitude after the first metre (6 is honest); *beyond* are poses with an
error of x, y or z above 4 standard deviations. CPU time an image is that of all of it, with optical
flow and the threads of OpenCV; that of the filter is beside it.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import NoTransform
from ros_visualise.core.params import specs, update
from ros_visualise.data import Image
from ros_visualise.estimation.inertial.filter import InertialFilter
from ros_visualise.estimation.inertial.lens import FOCAL_SIGMA
from ros_visualise.estimation.inertial.messages import InertialInput
from ros_visualise.estimation.inertial.odometry import InertialPose
from ros_visualise.estimation.settings import CAMERA_TURN, CameraErrors
from ros_visualise.geometry import se3
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.geometry.trajectory_errors import nees
from ros_visualise.simulation.profiles import Profile, settings_of
from ros_visualise.simulation.robots import ROBOTS
from ros_visualise.simulation.simulator import Simulation
from ros_visualise.vision import color

Floats = npt.NDArray[np.float64]

REST_NS = 2_000_000_000
ERRORS = {  # of the camera's clock, s, and attitude, degrees, as a user would state them
    Profile.IDEAL: (0.02, 0.5),
    Profile.REALISTIC: (0.02, 0.5),
    Profile.HARD: (0.05, 1.5),
}
USUAL = 0.02, CAMERA_TURN  # those of the node, if none are stated


class FlownPose(NamedTuple):
    """A true pose T_map_base (4, 4), and its estimate."""

    true: Floats
    pose: InertialPose


def simulated(profile: Profile, seed: int, seconds: float) -> tuple[Any, Iterator[Any]]:
    """The settings of a flight, and its messages as (stamp_ns, name, message)."""
    settings = ROBOTS.find("quadrotor").params()
    known = {spec.name for spec in specs(settings)}
    errors = {name: value for name, value in settings_of(profile).items() if name in known}
    settings = update(settings, errors | {"map_to_odom": False})
    simulation = Simulation("quadrotor", "field", seed, None, settings)

    def messages() -> Iterator[Any]:
        begun = False
        for stamp_ns, name, message in simulation.run():
            if not begun and stamp_ns > REST_NS:
                simulation.add_mission("default")
                simulation.act("start_mission")
                begun = True
            if stamp_ns > seconds * 1e9:
                return
            yield stamp_ns, name, message

    return settings, messages()


def fly(
    profile: Profile, seed: int, seconds: float, is_stated: bool = True
) -> tuple[list[FlownPose], InertialInput, int]:
    """The poses of a flight, what found them, and the CPU time that took, ns.

    ``is_stated``: the camera's readout and errors are; otherwise all is as by default.
    """
    settings, messages = simulated(profile, seed, seconds)
    frames, taker, waiting = FrameTree(), None, list[Image]()
    truth: list[tuple[int, Floats]] = []
    poses: list[InertialPose] = []
    spent_ns = 0
    clock_s, turn = ERRORS[profile] if is_stated else USUAL
    readout_s = settings.camera_readout if is_stated else None
    errors = CameraErrors(clock_s, np.radians(turn), 5.0, FOCAL_SIGMA)
    for _, name, message in messages:
        if name in ("tf", "tf_static"):
            frames.add(message, name == "tf_static")
        elif name == "truth":
            T = se3.from_pose(message.position_xyz, message.quat_xyzw)
            truth.append((message.header.stamp_ns, T))
        elif name == "image":
            waiting.append(message)
            taker = taker or InertialInput(message.camera_info, "base_link", 200, readout_s, errors)
        if name not in ("imu", "tf") or taker is None:
            continue
        start_ns = time.process_time_ns()
        if name == "imu":
            taker.feel(message, frames)
        while waiting and is_known(frames, waiting[0]):
            image = waiting.pop(0)
            gray = color.to_gray(image.pixels, color.order_of(image.encoding))
            taker.see(image.header, gray, frames)
        poses += [pose for _, pose in taker.odometry.ready() if pose is not None]
        spent_ns += time.process_time_ns() - start_ns
    assert taker is not None
    return paired(truth, poses), taker, spent_ns


def is_known(frames: FrameTree, image: Image) -> bool:
    """True once the camera's pose at an image is on tf."""
    try:
        frames.lookup("base_link", image.header.frame_id, image.header.stamp_ns)
    except NoTransform:
        return False
    return True


def paired(truth: list[tuple[int, Floats]], poses: list[InertialPose]) -> list[FlownPose]:
    """Estimates with the true poses at their times, in the frame of the first."""
    stamps, found = [stamp for stamp, _ in truth], []
    for pose in poses:
        after = int(np.searchsorted(stamps, pose.stamp_ns))
        if 0 < after < len(stamps):
            part = (pose.stamp_ns - stamps[after - 1]) / (stamps[after] - stamps[after - 1])
            T = se3.interpolate(truth[after - 1][1], truth[after][1], part)
            found.append(FlownPose(T, pose))
    first = found[0]
    turn = first.pose.R @ first.true[:3, :3].T
    yaw = np.array([0, 0, 0, 0, 0, np.arctan2(turn[1, 0], turn[0, 0])])
    R = se3.exp(yaw)[0]
    aligned = se3.from_parts(R, first.pose.p - R @ first.true[:3, 3])
    return [FlownPose(aligned @ one.true, one.pose) for one in found]


def judged(flown: list[FlownPose]) -> dict[str, float]:
    """Figures of a flight; lengths in metres."""
    at = np.array([one.true[:3, 3] for one in flown])
    ways = np.concatenate([[0], np.linalg.norm(np.diff(at, axis=0), axis=1).cumsum()])
    normal, beyond, error = [], 0, np.zeros(6)
    for (true, pose), way in zip(flown, ways, strict=True):
        turn = se3.rotation_vector(pose.R @ true[:3, :3].T)
        error = np.concatenate([pose.p - true[:3, 3], turn])
        change = se3.about_itself(pose.p)
        covariance = change @ pose.covariance @ change.T
        if way > 1:
            normal.append(nees(error, covariance) or np.nan)
            beyond += bool((np.abs(error[:3]) > 4 * np.sqrt(np.diag(covariance)[:3])).any())
    end = float(np.linalg.norm(error[:3]))
    return {
        "way": float(ways[-1]),
        "drift": 100 * end / float(ways[-1]),
        "yaw": abs(float(np.degrees(error[5]))),
        "nees": float(np.mean(normal)),
        "beyond": beyond,
    }


def timed_filter() -> list[int]:
    """Let the filter count its CPU time, ns, image by image."""
    see, spent = InertialFilter.see, list[int]()

    def timed(self: InertialFilter, *arguments: Any) -> bool:
        start_ns = time.thread_time_ns()
        answer = see(self, *arguments)
        spent.append(time.thread_time_ns() - start_ns)
        return answer

    InertialFilter.see = timed  # type: ignore[method-assign]
    return spent


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--profile", nargs="*", default=["realistic", "hard"])
    parser.add_argument("--seeds", type=int, nargs="*", default=[0, 1, 2, 3, 4])
    parser.add_argument("--seconds", type=float, default=45.0, help="simulated (%(default)s)")
    parser.add_argument(
        "--defaults", action="store_true", help="state neither the camera's readout nor its errors"
    )
    args = parser.parse_args()
    spent = timed_filter()
    columns = ("profile", "seed", "way, m", "drift, %", "yaw, degrees", "NEES", "beyond", "lost")
    print("| " + " | ".join((*columns, "CPU ms an image (filter)")) + " |")
    print("|" + "---|" * (len(columns) + 1))
    for name in args.profile:
        for seed in args.seeds:
            spent.clear()
            flown, taker, total_ns = fly(Profile(name), seed, args.seconds, not args.defaults)
            found, lost = judged(flown), sum(one.pose.is_lost for one in flown)
            each = total_ns / 1e6 / taker.odometry.counts["images"]
            print(
                f"| {name} | {seed} | {found['way']:.1f} | {found['drift']:.2f} "
                f"| {found['yaw']:.1f} | {found['nees']:.1f} | {found['beyond']:.0f} "
                f"| {lost} of {len(flown)} | {each:.1f} ({np.mean(spent) / 1e6:.1f}) |",
                flush=True,
            )


if __name__ == "__main__":
    main()
