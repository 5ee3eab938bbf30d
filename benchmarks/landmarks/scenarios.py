"""Navigation and landings by the command line, in simulations from ideal to hard.

    python benchmarks/landmarks/scenarios.py [--seeds 5] [--profile realistic] [--scenario night]

Every run is one command as a user types it: a quadrotor, its rendered images, `tag_detector`,
`landmark_navigator`. Its recording is held against `/ground_truth/odom` without any alignment: root
mean square of the position (and of the odometry), mean NEES of the pose (6 is honest), the share of
poses that are published, times that it got lost, the longest time without a pose, and false
confidence: poses with an error above 4 standard deviations of x, y or z. `control=estimate` in all
of them: the mission is steered by the navigator, at 7 m, so that it sees a tag before it leaves its
start. A landing is held against `/ground_truth/pad`.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ros_visualise.geometry.trajectory_errors import nees, pose_error
from ros_visualise.messages.recorded import content
from ros_visualise.sources.opening import open_recording

Floats = npt.NDArray[np.float64]

MISSION = """
shape: square
size: [6, 6]
center: [0, 0.5]
height: 7
speed: 1.5
laps: 0
"""
LANDING = """
land_on: pad
waypoints: [[-9, -1, 6]]
height: 6
speed: 2
"""
TRUTH, PAD, POSE, ODOM = "/ground_truth/odom", "/ground_truth/pad", "/navigation/pose", "/odom"
SCENARIOS: Mapping[str, tuple[str, ...]] = {
    "known map": ("quadrotor.gps=false",),
    "built map": ("quadrotor.gps=false",),
    "built map, GPS": ("landmark_navigator.gps_origin=49,8.4,116",),
    "few tags": ("quadrotor.gps=false", "quadrotor.tags_covered=0.8"),
    "few tags, built map": ("quadrotor.gps=false", "quadrotor.tags_covered=0.8"),
    "night": ("quadrotor.gps=false", "quadrotor.camera_light=0.01"),
    "landing": ("quadrotor.gps=false",),
}
KNOWN = ("known map", "few tags", "night")
"""Those in a map that was made before, at `ideal`."""
COLUMNS = (
    *("profile", "scenario (runs)", "rms, worst (odometry) m", "NEES", "published", "lost"),
    *("longest without s", "beyond 4 sigma: poses, runs", "landed within 0.15 m, worst", "failed"),
)
LIMIT_S = 900


class Result(NamedTuple):
    """Figures of one run; lengths in metres, times in seconds."""

    position: float
    odometry: float
    nees: float
    published: float
    lost: int
    without: float
    beyond: float
    landed: float
    failure: str


def run(options: list[str], limit_s: float = LIMIT_S) -> subprocess.CompletedProcess[str]:
    """Run ``ros-visualise``."""
    command = [sys.executable, "-m", "ros_visualise", *options]
    return subprocess.run(command, capture_output=True, text=True, timeout=limit_s, check=False)


def fly(scenario: str, profile: str, seed: int, seconds: float, folder: Path) -> Result:
    """One run of a scenario."""
    landing, record = scenario == "landing", folder / "run.mcap"
    mission = folder / "mission.yaml"
    mission.write_text(LANDING if landing else MISSION)
    options = ["sim", "quadrotor", "--profile", profile, "--seed", str(seed), "--view", "none"]
    options += ["--mission", str(mission), "--rate", "0", "--duration", f"{seconds:g}"]
    options += ["--record", f"{record}@{TRUTH},{PAD},{POSE},{ODOM}", "--overwrite", "--navigate"]
    if scenario in KNOWN:
        options.append(str(folder / "map.yaml"))
    for one in ("quadrotor.control=estimate", *SCENARIOS[scenario]):
        options += ["--set", one]
    done = run(options)
    lines = done.stderr.splitlines()
    failures = [line for line in lines if "aborted" in line or "tipped" in line]
    lost = sum("landmark_navigator: lost" in line for line in lines)
    return judge(record, lost, landing, failures[0].split(": ", 1)[-1] if failures else "")


def judge(record: Path, lost: int, landing: bool, failure: str) -> Result:
    """The figures of a recording."""
    found = read(record)
    truth = {m.header.stamp_ns: m for m in found.get(TRUTH, [])}
    errors, sigmas, normal, stamps = [], [], [], []
    for pose in found.get(POSE, []):
        true = truth.get(pose.header.stamp_ns)
        if true is None:
            continue
        error = pose_error(pose.position_xyz, pose.quat_xyzw, true.position_xyz, true.quat_xyzw)
        errors.append(error[:3])
        sigmas.append(np.sqrt(np.diag(pose.covariance)[:3]))
        normal.append(nees(error, pose.covariance) or np.nan)
        stamps.append(pose.header.stamp_ns / 1e9)
    ends = [min(truth) / 1e9, *stamps, max(truth) / 1e9]
    beyond = np.abs(errors) > 4 * np.array(sigmas) if errors else np.zeros((1, 3))
    return Result(
        float(np.sqrt((np.array(errors) ** 2).sum(axis=1).mean())) if errors else np.nan,
        drift(found.get(ODOM, []), truth),
        float(np.nanmean(normal)) if normal else np.nan,
        len(errors) / len(truth),
        lost,
        float(np.diff(ends).max()),
        float(np.any(beyond, axis=1).mean()),
        off_pad(found) if landing else np.nan,
        failure,
    )


def read(path: Path) -> dict[str, list[Any]]:
    """The messages of a recording, by topic."""
    found: dict[str, list[Any]] = {}
    with closing(open_recording(path)) as recording:
        for topic, _, message in recording.read():
            if topic in (TRUTH, PAD, POSE, ODOM):
                found.setdefault(topic, []).append(content(message))
    return found


def drift(odometry: list[Any], truth: Mapping[int, Any]) -> float:
    """Root mean square of the odometry's position, which begins at the true start."""
    start = truth[min(truth)]
    yaw = 2 * np.arctan2(start.quat_xyzw[2], start.quat_xyzw[3])
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    off = [
        turn @ m.position_xyz + start.position_xyz - truth[m.header.stamp_ns].position_xyz
        for m in odometry
        if m.header.stamp_ns in truth
    ]
    return float(np.sqrt((np.array(off) ** 2).sum(axis=1).mean()))


def off_pad(found: Mapping[str, list[Any]]) -> float:
    """Distance of robot and pad on the ground at the end; infinite if it still flies."""
    apart = found[TRUTH][-1].position_xyz - found[PAD][-1].position_xyz
    return float(np.hypot(*apart[:2])) if apart[2] < 0.25 else np.inf


def main() -> None:
    """Fly, and print one table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--profile", nargs="*", default=["realistic", "hard"])
    parser.add_argument("--scenario", nargs="*", default=[*SCENARIOS])
    options = parser.parse_args()
    print(f"| {' | '.join(COLUMNS)} |")
    print("|---" * len(COLUMNS) + "|", flush=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if set(KNOWN) & set(options.scenario):
            made = run(["landmarks", "quadrotor", "--map", str(folder / "map.yaml")])
            if made.returncode:
                sys.exit(made.stderr)
        for profile in options.profile:
            for scenario in options.scenario:
                seeds = range(options.first, options.first + options.seeds)
                runs = [fly(scenario, profile, s, options.seconds, folder) for s in seeds]
                print(row(profile, scenario, runs), flush=True)


def row(profile: str, scenario: str, runs: list[Result]) -> str:
    """A line of the table."""
    p, landed = [r.position for r in runs], [r.landed for r in runs]
    cells = [
        profile,
        f"{scenario} ({len(runs)})",
        f"{np.nanmean(p):.2f}, {np.nanmax(p):.2f} ({np.mean([r.odometry for r in runs]):.2f})",
        f"{np.nanmean([r.nees for r in runs]):.1f}",
        f"{100 * np.mean([r.published for r in runs]):.0f}%",
        f"{sum(r.lost for r in runs)}",
        f"{max(r.without for r in runs):.1f}",
        f"{100 * np.mean([r.beyond for r in runs]):.1f}%, {sum(r.beyond > 0 for r in runs)}",
        "-" if np.all(np.isnan(landed)) else f"{sum(d < 0.15 for d in landed)}, {max(landed):.2f}",
        f"{sum(bool(r.failure) for r in runs)}",
    ]
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    main()
