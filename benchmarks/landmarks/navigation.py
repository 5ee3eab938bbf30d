"""Accuracy, consistency and speed of the navigator over many computed flights of 500 m.

    python benchmarks/landmarks/navigation.py [--seeds 30] [--metres 500] [--case 0] [--tags 500]

A quadrotor flies rows at 10 m over 56 tags of 0.6 m without GPS; its odometry is wrong by 1 % of
the way (`tests/estimation/flights.py`). Corners are computed, with the noise that tags of
their size have. Once with a map whose tags are off by 1 cm and 0.6 degrees, once without any; with
the odometry alone, and with an IMU; over four tags only, with the odometry alone and with GPS and
an IMU; and over 100 posts that look all alike and stand on ground which is level to 0.1 m, each
seen to a pixel.

The NEES is the squared error by its covariance: 6 on average where that is honest, and the mean of
30 flights is between 4.82 and 7.30 with 95 %.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path
from typing import NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "estimation"))
from flights import GPS_ORIGIN, T_BASE_CAMERA, Flight, field_of_tags, lawn_mower

from ros_visualise.data import Floats, Imu, NavSatFix
from ros_visualise.estimation.camera_view import view_of
from ros_visualise.estimation.imu import ImuNoise, Mounting
from ros_visualise.estimation.landmark import KnownLandmark
from ros_visualise.estimation.landmark_map import MapMode, MapRules
from ros_visualise.estimation.navigator import Navigator
from ros_visualise.estimation.odometry import OdometryNoise
from ros_visualise.estimation.points import GroundPlane
from ros_visualise.estimation.sensors import SENSORS, Reading
from ros_visualise.estimation.sensors.gps import GpsErrorParams
from ros_visualise.estimation.settings import NavigatorSettings
from ros_visualise.geometry.rigid import IDENTITY
from ros_visualise.geometry.se3 import about_itself, turn_between

LEVEL = float(np.radians(0.5))
ODOMETRY = OdometryNoise(0.01, 0.0, 0.0, 0.02, 0.003, 0.0, 0.0, 0.0)
IMU = ImuNoise(3e-4, 2e-3, 5e-3, 0.05, 2e-5, 2e-4)
GPS = GpsErrorParams(gps_slow=0.966, gps_origin=", ".join(map(str, GPS_ORIGIN)))
IN_THE_MIDDLE = Mounting(np.eye(3), np.zeros(3))
SPREAD = np.repeat([0.01, 0.01], 3)  # of the given map: metres, radians
SETTLED = 125  # odometries in 5 s


class Case(NamedTuple):
    """What is flown over, and with."""

    mode: MapMode
    tags: int
    imu: bool
    gps: bool
    posts: int = 0


CASES = (
    Case(MapMode.FROZEN, 56, False, False),
    Case(MapMode.FROZEN, 56, True, False),
    Case(MapMode.BUILD, 56, False, False),
    Case(MapMode.BUILD, 56, True, False),
    Case(MapMode.FROZEN, 4, False, False),
    Case(MapMode.FROZEN, 4, False, True),
    Case(MapMode.FROZEN, 4, True, True),
    Case(MapMode.BUILD, 0, False, False, 100),
    Case(MapMode.BUILD, 0, True, False, 100),
)
GROUND = GroundPlane(0.0, 0.01, 0.1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=30)
    parser.add_argument("--metres", type=float, default=500)
    parser.add_argument("--case", type=int, action="append", help="one of them, from 0 on")
    parser.add_argument("--tags", type=int, help="as many instead of those of the case")
    args = parser.parse_args()
    for case in [CASES[number] for number in args.case or range(len(CASES))]:
        case = case._replace(tags=args.tags) if args.tags else case
        rows = np.array([fly(seed, case, args.metres) for seed in range(args.seeds)])
        print_rows(case, rows)


def print_rows(case: Case, rows: Floats) -> None:
    ate, aligned, odo, nees, marks, marks_aligned, marks_nees, *times = rows.T
    name = "map given" if case.mode is MapMode.FROZEN else "map built"
    helped = f"IMU {case.imu}, GPS {case.gps}"
    over = f"{case.posts} posts" if case.posts else f"{case.tags} tags"
    print(f"{name}, {over}, {helped}, {len(rows)} flights")
    print(f"  ATE (m): mean {ate.mean():.3f}, worst {ate.max():.3f}; aligned {aligned.mean():.3f}")
    print(f"  of the odometry {odo.mean():.2f}: {(odo / ate).min():.0f} times as much at least")
    print(f"  NEES of the robot: mean {nees.mean():.2f}, from {nees.min():.1f} to {nees.max():.1f}")
    if case.mode is MapMode.BUILD:
        print(
            f"  landmarks, RMS (m): {marks.mean():.3f}; aligned {marks_aligned.mean():.3f},", end=""
        )
        print(f" worst {marks_aligned.max():.3f}; NEES {marks_nees.mean():.2f}")
    ms = [float(np.median(one)) for one in times]
    print(f"  CPU ms of an image: median {ms[0]:.2f}, p99 {ms[1]:.2f}; of an odometry: ", end="")
    print(f"{ms[2]:.2f}, {ms[3]:.2f}", flush=True)


def fly(seed: int, case: Case, metres: float) -> tuple[float, ...]:
    random = np.random.default_rng([seed, 1])
    feet = random.uniform([-4, -8, 0], [68, 60, 0], (case.posts, 3))
    feet[:, 2] = random.normal(GROUND.height_m, GROUND.roughness_m, case.posts)
    flight = Flight(
        field_of_tags(random, 64, 64, case.tags) if case.tags else {},
        lawn_mower(metres),
        seed,
        level_rad=LEVEL,
        poses_of=5,
        posts=feet,
    )
    known = {} if case.mode is MapMode.BUILD else given(flight, random)
    rules = MapRules(case.mode, plane=GROUND)
    settings = NavigatorSettings(rules, ODOMETRY, IMU, level_rad=LEVEL, sensors={"gps": GPS})
    navigator = Navigator(settings, known, IDENTITY)
    imu = flight.imu() if case.imu else []
    gps = flight.gps() if case.gps else []
    there, truth, odometry, nees = [], [], [], []
    took_s: dict[str, list[float]] = {"image": [], "odometry": []}
    for number, stamp, pose, seen in flight.told():
        feel(navigator, imu, gps, stamp)
        start_s = time.thread_time()
        now = navigator.odometry(stamp, pose)
        took_s["odometry"].append(time.thread_time() - start_s)
        if seen is not None:
            start_s = time.thread_time()
            navigator.see(view_of(seen, T_BASE_CAMERA))
            took_s["image"].append(time.thread_time() - start_s)
        if now is None:
            continue
        T = flight.true_pose(number)
        there.append(now.T_map_base[:3, 3])
        truth.append(T[:3, 3])
        odometry.append(flight.T_map_odom[:3, :3] @ pose[:3])
        if number > SETTLED:
            turned = turn_between(T[:3, :3], now.T_map_base[:3, :3])
            error = np.concatenate([T[:3, 3] - there[-1], turned])
            nees.append(error @ np.linalg.solve(now.covariance, error))
    at, true = np.array(there), np.array(truth)
    ms = [np.percentile(one, [50, 99]) * 1e3 for one in took_s.values()]
    found = rms(at, true), rms(aligned(at, true), true), rms(np.array(odometry), true)
    return (
        *found,
        float(np.mean(nees)),
        *landmarks(navigator, flight),
        *np.concatenate(ms).tolist(),
    )


def feel(navigator: Navigator, imu: list[Imu], gps: list[NavSatFix], stamp_ns: int) -> None:
    """What the sensors have measured until now."""
    while imu and imu[0].header.stamp_ns <= stamp_ns:
        one = imu.pop(0)
        navigator.imu(one.header.stamp_ns, one.angular_xyz, one.linear_xyz, IN_THE_MIDDLE)
    while gps and gps[0].header.stamp_ns <= stamp_ns:
        fix = gps.pop(0)
        values = SENSORS.find("gps").read(fix, GPS)
        navigator.read(Reading("gps", fix.header.stamp_ns, *values, IN_THE_MIDDLE))


def given(flight: Flight, random: np.random.Generator) -> dict[str, KnownLandmark]:
    """The map, with the errors that its covariance tells of."""
    known = {}
    for id, tag in flight.tags.items():
        off = random.normal(0, SPREAD)
        R = cv2.Rodrigues(-off[3:])[0] @ tag.T[:3, :3]
        spread = np.diag(SPREAD**2)
        known[f"tag36h11_{id}"] = KnownLandmark.of(R, tag.T[:3, 3] - off[:3], spread, tag.side_m)
    return known


def landmarks(navigator: Navigator, flight: Flight) -> tuple[float, float, float]:
    """RMS of their positions in metres, the same aligned, and their NEES."""
    state, used = navigator.state, navigator.map.used
    if navigator.settings.rules.mode is MapMode.FROZEN:
        return np.nan, np.nan, np.nan
    at, true, nees = [], [], []
    for one in used:
        (R,), (found_p,), (twist,) = state.marginals([one.key])
        covariance = about_itself(found_p) @ twist @ about_itself(found_p).T
        if one.has_orientation:
            T = flight.tags[int(one.name.rpartition("_")[2])].T
            turned, size = turn_between(T[:3, :3], R), 6
        else:
            T, turned, size = np.eye(4), np.zeros(3), 3
            T[:3, 3] = min(flight.posts, key=lambda foot: float(np.linalg.norm(foot - found_p)))
        at.append(found_p)
        true.append(T[:3, 3])
        error = np.concatenate([true[-1] - at[-1], turned])[:size]
        nees.append(error @ np.linalg.solve(covariance[:size, :size], error))
    found, there = np.array(at), np.array(true)
    return rms(found, there), rms(aligned(found, there), there), float(np.mean(nees))


def rms(found: Floats, true: Floats) -> float:
    return float(np.sqrt(((found - true) ** 2).sum(axis=1).mean()))


def aligned(found: Floats, true: Floats) -> Floats:
    """Turned and shifted onto the truth. Source: S. Umeyama, 1991, without a scale."""
    a, b = found - found.mean(axis=0), true - true.mean(axis=0)
    U, _, V = np.linalg.svd(a.T @ b)
    flip = np.diag([1, 1, np.sign(np.linalg.det(U @ V))])
    turned: Floats = a @ (U @ flip @ V) + true.mean(axis=0)
    return turned


if __name__ == "__main__":
    main()
