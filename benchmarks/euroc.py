"""Visual-inertial odometry of EuRoC and TUM-VI: `python benchmarks/euroc.py FOLDER ...`.

Folders are sequences of these data sets, such as `MH_01_easy` or `dataset-room1_512_16`. One camera
and the IMU go through the code of the node `visual_odometry`. ATE is the root mean square of the
positions of the body after alignment by a rotation and a translation (SE3), as those beside it,
which are as published:

- OpenVINS, one camera (`mono_ov_slam`, aligned by yaw and position): P. Geneva et al., OpenVINS: a
  research platform for visual-inertial estimation, ICRA 2020, table II
- Basalt, two cameras, odometry alone: V. Usenko et al., Visual-inertial mapping with non-linear
  factor recovery, RA-L 2020, for EuRoC; for TUM-VI as L. von Stumberg and D. Cremers, DM-VIO,
  RA-L 2022, quote it
- ORB-SLAM3, two cameras, with its loops closed: C. Campos et al., ORB-SLAM3, T-RO 2021, for EuRoC;
  for the rooms of TUM-VI it states 0.009 m on average

`--make FOLDER` writes a sequence of that format by the simulator, with a camera that is fixed to a
quadrotor, and `--fisheye` gives that an equidistant lens and TUM-VI's files.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np

from ros_visualise.data import Floats, Image, Imu, Odometry, Transforms
from ros_visualise.estimation.inertial.messages import InertialInput
from ros_visualise.geometry import se3
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.geometry.trajectory_errors import absolute_errors, align
from ros_visualise.simulation.robots import ROBOTS
from ros_visualise.simulation.simulator import Simulation
from ros_visualise.sources.opening import open_recording
from ros_visualise.vision import color

PUBLISHED = {  # OpenVINS, Basalt, ORB-SLAM3; metres
    "MH_01": (None, 0.07, 0.036),
    "MH_02": (None, 0.06, 0.033),
    "MH_03": (None, 0.07, 0.035),
    "MH_04": (None, 0.13, 0.051),
    "MH_05": (None, 0.11, 0.082),
    "V1_01": (0.058, 0.04, 0.038),
    "V1_02": (0.076, 0.05, 0.014),
    "V1_03": (0.063, 0.10, 0.024),
    "V2_01": (0.124, 0.04, 0.032),
    "V2_02": (0.074, 0.05, 0.014),
    "V2_03": (None, None, 0.024),
    "room1": (None, 0.09, None),
    "room2": (None, 0.07, None),
    "room3": (None, 0.13, None),
    "room4": (None, 0.05, None),
    "room5": (None, 0.13, None),
    "room6": (None, 0.02, None),
}
START_NS = 1_500_000_000_000_000_000  # of a sequence that is made


class Run(NamedTuple):
    """Poses T_odom_body (N, 4, 4) and the true ones at their times, and what it took."""

    T: Floats
    T_true: Floats
    images: int
    lost: int
    reason: str
    ms: float


def run(folder: Path) -> Run:
    """The odometry of a sequence."""
    frames, taker, found = FrameTree(), None, []
    truth: list[tuple[int, Floats]] = []
    reason, start_ns = "no images", time.process_time_ns()
    with closing(open_recording(folder)) as recording, closing(recording.read()) as entries:
        for entry in entries:
            message = entry.message
            if isinstance(message, Transforms):
                frames.add(message, True)
            elif isinstance(message, Odometry):
                T = se3.from_pose(message.position_xyz, message.quat_xyzw)
                truth.append((message.header.stamp_ns, T))
            elif isinstance(message, Imu) and taker is not None:
                taker.feel(message, frames)
            elif isinstance(message, Image) and entry.topic.startswith("/cam00/"):
                taker = taker or InertialInput(message.camera_info, "base_link")
                gray = color.to_gray(message.pixels, color.order_of(message.encoding))
                taker.see(message.header, gray, frames)
            if taker is not None:
                found += [pose for _, pose in taker.odometry.ready() if pose is not None]
                reason = taker.problem or taker.odometry.reason
    images = taker.odometry.counts["images"] if taker is not None else 0
    ms = (time.process_time_ns() - start_ns) / 1e6 / max(images, 1)
    T = np.array([se3.from_parts(one.R, one.p) for one in found]).reshape(-1, 4, 4)
    there, T_true = at_times(truth, [one.stamp_ns for one in found])
    lost = sum(one.is_lost for one in found)
    return Run(T[there], T_true, images, lost, reason, ms)


def at_times(truth: list[tuple[int, Floats]], stamps_ns: list[int]) -> tuple[list[int], Floats]:
    """Places of the stamps within the ground truth, and the true poses there."""
    known, there, T = [stamp_ns for stamp_ns, _ in truth], [], []
    for place, stamp_ns in enumerate(stamps_ns):
        after = int(np.searchsorted(known, stamp_ns))
        if 0 < after < len(known) and known[after] - known[after - 1] < 100_000_000:
            part = (stamp_ns - known[after - 1]) / (known[after] - known[after - 1])
            T.append(se3.interpolate(truth[after - 1][1], truth[after][1], part))
            there.append(place)
    return there, np.array(T).reshape(-1, 4, 4)


def ate(found: Run) -> float:
    """Root mean square of the positions after alignment, metres."""
    T = align(found.T_true, found.T, "se3").apply(found.T)
    errors = absolute_errors(found.T_true, T).translation_m
    return float(np.sqrt((errors**2).mean()))


# a sequence by the simulator


def flown(seed: int, seconds: float) -> Iterator[tuple[int, str, Any]]:
    """Messages of a flight of a camera that is fixed to a quadrotor, after two seconds at rest."""
    from ros_visualise.core.params import update

    fixed = {"camera_gimbal": False, "camera_rate": 20.0, "imu_rate": 200.0, "mission_delay": 2.0}
    settings = update(ROBOTS.find("quadrotor").params(), fixed)
    simulation = Simulation("quadrotor", "field", seed, "default", settings)
    for stamp_ns, name, message in simulation.run():
        if stamp_ns > seconds * 1e9:
            return
        yield stamp_ns, name, message


class Lens:
    """The pictures of a pinhole camera, as an equidistant lens of 512x512 would take them."""

    K = np.array([[470.0, 0, 256], [0, 470, 256], [0, 0, 1]])
    D = np.array([0.0034, 0.0007, -0.002, 0.0002])

    def __init__(self, info: Any) -> None:
        places = np.stack(np.meshgrid(np.arange(512.0), np.arange(512.0)), -1).reshape(-1, 1, 2)
        rays = cv2.fisheye.undistortPoints(places, self.K, self.D)[:, 0]
        pixels = rays @ info.K[:2, :2].T + info.K[:2, 2]
        self._map = pixels.reshape(512, 512, 2).astype(np.float32)

    def image(self, gray: Any) -> Any:
        return cv2.remap(gray, self._map, None, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)


def make(folder: Path, fisheye: bool, seed: int, seconds: float) -> None:
    """Write a sequence in EuRoC's format, or in that of TUM-VI."""
    body = folder / "mav0"
    truth_name = "mocap0" if fisheye else "state_groundtruth_estimate0"
    tables: dict[str, list[str]] = {name: [] for name in ("cam0", "imu0", truth_name)}
    (body / "cam0" / "data").mkdir(parents=True)
    frames, lens, info = FrameTree(), None, None
    for _, name, message in flown(seed, seconds):
        if name in ("tf", "tf_static"):
            frames.add(message, name == "tf_static")
            continue
        stamp = str(START_NS + message.header.stamp_ns) if hasattr(message, "header") else ""
        if name == "image":
            info, frame = message.camera_info, message.header.frame_id
            gray = color.to_gray(message.pixels, color.order_of(message.encoding))
            lens = lens or (Lens(info) if fisheye else None)
            gray = lens.image(gray) if lens else gray
            cv2.imwrite(str(body / "cam0" / "data" / f"{stamp}.png"), gray)
            tables["cam0"].append(f"{stamp},{stamp}.png")
        elif name == "imu":
            imu = message.header.frame_id
            values = [*message.angular_xyz, *message.linear_xyz]
            tables["imu0"].append(",".join([stamp, *map(repr, map(float, values))]))
        elif name == "truth":
            x, y, z, w = map(float, message.quat_xyzw)
            values = [*map(float, message.position_xyz), w, x, y, z]
            tables[truth_name].append(",".join([stamp, *map(repr, values)]))
    assert info is not None, "the flight is too short"
    for name, lines in tables.items():
        (body / name).mkdir(exist_ok=True)
        (body / name / "data.csv").write_text("\n".join(["#timestamp [ns]", *lines, ""]))
    T_body_camera, T_body_imu = (frames.lookup("base_link", one, 0) for one in (frame, imu))
    write_calibration(folder, info, T_body_camera, T_body_imu, fisheye)


def write_calibration(folder: Path, info: Any, T: Floats, T_imu: Floats, fisheye: bool) -> None:
    """``sensor.yaml`` of EuRoC, or ``camchain.yaml`` of TUM-VI; the body is that of the truth."""
    K, D = (Lens.K, Lens.D) if fisheye else (info.K, np.resize(info.D, 4))
    size = [512, 512] if fisheye else [info.width, info.height]
    head = f"camera_model: pinhole\nintrinsics: {[K[0, 0], K[1, 1], K[0, 2], K[1, 2]]}\n"
    head = head.replace("np.float64(", "").replace(")", "") + f"resolution: {size}\n"
    body = folder / "mav0"
    pose = f"T_BS:\n  cols: 4\n  rows: 4\n  data: {T_imu.ravel().tolist()}\n"
    (body / "imu0" / "sensor.yaml").write_text("sensor_type: imu\n" + pose)
    if not fisheye:
        pose = f"T_BS:\n  cols: 4\n  rows: 4\n  data: {T.ravel().tolist()}\n"
        model = f"distortion_model: radial-tangential\ndistortion_coefficients: {D.tolist()}\n"
        (body / "cam0" / "sensor.yaml").write_text(head + model + pose)
        return
    chain = f"{head}distortion_model: equidistant\ndistortion_coeffs: {D.tolist()}\n"
    chain += f"T_cam_imu: {se3.inverse(T).tolist()}\n"
    (folder / "dso").mkdir()
    indented = "".join(f"  {line}\n" for line in chain.splitlines())
    (folder / "dso" / "camchain.yaml").write_text("cam0:\n" + indented)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folders", type=Path, nargs="*", metavar="FOLDER", help="sequences")
    parser.add_argument("--make", type=Path, metavar="FOLDER", help="write one by the simulator")
    parser.add_argument("--fisheye", action="store_true", help="that one with TUM-VI's lens")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=30.0)
    args = parser.parse_args()
    if args.make is not None:
        make(args.make, args.fisheye, args.seed, args.seconds)
    if not args.folders:
        return
    print(
        "| sequence | poses of images | lost | way, m | ATE, m | CPU ms | OpenVINS | Basalt |",
        end="",
    )
    print(" ORB-SLAM3 |\n" + "|---" * 9 + "|")
    for folder in args.folders:
        found = run(folder)
        name = next((one for one in PUBLISHED if one in folder.resolve().name), "")
        others = [f"{one:.3f}" if one else "-" for one in PUBLISHED.get(name, (None,) * 3)]
        way = np.linalg.norm(np.diff(found.T_true[:, :3, 3], axis=0), axis=1).sum()
        error = f"{ate(found):.3f}" if len(found.T) > 2 else f"none: {found.reason}"
        cells = [folder.name, f"{len(found.T)} of {found.images}", f"{found.lost}", f"{way:.1f}"]
        cells += [error, f"{found.ms:.0f}", *others]
        print(f"| {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
