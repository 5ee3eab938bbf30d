"""A sequence of KITTI's odometry benchmark.

Its images are rectified, its scans are already compensated for the car's motion. Times are seconds
since the sequence began, and are kept so. The ground truth is the pose of rectified camera 0 in its
own first frame; here it is the pose of base_link in ``odom``, which is base_link at the first one.

base_link is the point on the road below the scanner, with the scanner's axes; without a scanner's
calibration it is below camera 0. Their heights, 1.73 m and 1.65 m, are on KITTI's page of the
setup.

Source: A. Geiger et al., Are we ready for Autonomous Driving?, CVPR 2012, and the benchmark's
readme.txt.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import OpenError
from ros_visualise.data import Floats, Header, Odometry
from ros_visualise.geometry import rotations, se3
from ros_visualise.sources.kitti import calibration, sensors, stamps
from ros_visualise.sources.kitti.calibration import CalibrationFile
from ros_visualise.sources.kitti.files import (
    CAMERAS,
    Findings,
    FrameFiles,
    list_files,
    poses_file,
    read_lines,
)
from ros_visualise.sources.kitti.sensors import (
    BASE,
    MAP,
    ODOM,
    VELODYNE,
    Places,
    camera_series,
    moving_series,
    optical_frame,
    scanner_series,
    static_series,
)
from ros_visualise.sources.recordings.series import SeriesRecording
from ros_visualise.sources.series import DamagedFile, Series

_NS = 1_000_000_000
_PERIOD_NS = _NS // 10
_POSE_TOPICS = 2  # messages of one pose: odom, tf
T_BASE_VELODYNE = se3.from_parts(np.eye(3), [0, 0, 1.73])
T_BASE_CAM0 = se3.from_parts([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], [0, 0, 1.65])
"""Looking straight ahead, where there is no calibration."""

_Times = dict[str, npt.NDArray[np.int64]]


def open_sequence(folder: Path) -> SeriesRecording:
    """The recording of a folder ``sequences/NN``; raises OpenError if it holds no frames."""
    images = {c: list_files(folder / f"image_{c}", "png") for c in CAMERAS}
    parts = {f"image_{c}": files for c, files in images.items() if files}
    scans = list_files(folder / "velodyne", "bin")
    if scans:
        parts = {"velodyne": scans, **parts}
    findings = Findings(folder)
    frames = max((files.numbers[-1] + 1 for files in parts.values()), default=0)
    truth = _read_truth(frames, findings)
    if truth:
        parts["poses"] = FrameFiles(poses_file(folder).parent, ("",) * len(truth), tuple(truth))
    if not parts:
        raise OpenError(f"{folder}: holds no frames; unpack the benchmark's images or scans there")
    times = _stamp(parts, findings)
    start_ns = min(int(one.min()) for one in times.values())
    calib = CalibrationFile(path if (path := folder / "calib.txt").exists() else None)
    T_rect0_velodyne = _find_scanner(calib, findings.notes)
    series, places = _sensors(images, scans, times, calib, T_rect0_velodyne)
    calib.report(findings)
    if truth:
        poses = _poses_of_base(np.stack(list(truth.values())), T_rect0_velodyne)
        series = [*_truth_series(start_ns, times["poses"], poses), *series]
        places = [(MAP, ODOM, np.eye(4)), *places]
    series = [static_series(start_ns, places), *series]
    size = sum(files.size for files in parts.values())
    notes, loss = findings.notes, findings.loss
    return SeriesRecording(folder, "KITTI odometry", size, series, notes, loss=loss)


def _read_truth(frames: int, findings: Findings) -> dict[int, Floats]:
    """T_first_camera0, 4x4, by number of the frame; the file has one for each, or is damaged."""
    path = poses_file(findings.folder)
    if not path.exists():
        return {}
    try:
        lines = read_lines(path)
    except DamagedFile:
        lines = []
    poses = [_parse_pose(line) for line in lines]
    found = {number: T for number, T in enumerate(poses) if T is not None}
    whole = max([frames, *(number for number, line in enumerate(lines, 1) if line.strip())])
    if missing := whole - len(found):
        why = (
            f"{missing} of {whole} poses are missing or damaged;"
            " their messages on /odom and /tf skipped"
        )
        findings.lose(DamagedFile(path, why), missing * _POSE_TOPICS)
    return found


def _parse_pose(line: str) -> Floats | None:
    try:
        row = np.array(line.split(), np.float64)
    except ValueError:
        return None
    if len(row) != 12 or not np.isfinite(row).all():
        return None
    T = calibration.rigid_3x4(row)
    return T if calibration.is_rotation(T[:3, :3]) else None


def _find_scanner(calib: CalibrationFile, notes: list[str]) -> Floats | None:
    """T_rect0_velodyne, if it is known; not all sequences have it."""
    if not calib.exists:
        notes.append("no calib.txt: the cameras have no camera_info and no tf frames")
        return None
    if "Tr" not in calib.rows and calib.rows and all(map(len, calib.rows.values())):
        notes.append("calib.txt has no Tr: the scanner's pose is unknown")
        return None
    is_known = calib.has(("Tr",), [f"{BASE} -> {VELODYNE}"])
    return calibration.rigid_3x4(calib.rows["Tr"]) if is_known else None


def _stamp(parts: dict[str, FrameFiles], findings: Findings) -> _Times:
    path = findings.folder / "times.txt"
    lines = stamps.read_times(path, _parse_seconds)
    found = [stamps.FrameTimes(name, path, lines, files.numbers) for name, files in parts.items()]
    lacking = [one.name for one in found if one.lacking]
    periods_ns = dict.fromkeys(parts, _PERIOD_NS)
    times, damaged = stamps.complete(found, findings.notes, True, 0, periods_ns)
    is_part = lacking == ["poses"] and len(parts) > 1  # with the poses of the whole sequence
    if damaged and is_part:
        stamped = damaged[0].why.partition("; ")[2]
        findings.notes.append(f"poses: more than the {len(lines)} times of times.txt; {stamped}")
    elif damaged:
        findings.lose(damaged[0])
    for name, files in parts.items():
        if name != "poses":
            findings.compare(name, len(files), len(lines))
    return times


def _parse_seconds(line: str) -> int | None:
    """Seconds since the start, as ns; None on a line without them."""
    try:
        seconds = float(line)
    except ValueError:
        return None
    return round(seconds * _NS) if 0 <= seconds < 1e9 else None


def _sensors(
    images: dict[int, FrameFiles],
    scans: FrameFiles,
    times: _Times,
    calib: CalibrationFile,
    T_rect0_velodyne: Floats | None,
) -> tuple[list[Series], Places]:
    series: list[Series] = []
    places: Places = []
    parent, above = BASE, se3.inverse(T_BASE_CAM0)
    if T_rect0_velodyne is not None:
        places.append((BASE, VELODYNE, T_BASE_VELODYNE))
        parent, above = VELODYNE, T_rect0_velodyne
    if scans:
        series.append(scanner_series(scans, times["velodyne"]))
    for number, files in images.items():
        if not files:
            continue
        size = sensors.first_size(files)
        camera = calibration.sequence_camera(number, calib, size, above, len(files))
        series += camera_series(number, "image_rect", files, times[f"image_{number}"], camera.info)
        if camera.T_velodyne_camera is not None:
            places.append((parent, optical_frame(number), camera.T_velodyne_camera))
    return series, places


def _poses_of_base(T_first_cam0: Floats, T_rect0_velodyne: Floats | None) -> Floats:
    """T_odom_base, (N, 4, 4)."""
    T_base_cam0 = T_BASE_CAM0
    if T_rect0_velodyne is not None:
        T_base_cam0 = T_BASE_VELODYNE @ se3.inverse(T_rect0_velodyne)
    found: Floats = T_base_cam0 @ T_first_cam0 @ se3.inverse(T_base_cam0)
    return found


def _truth_series(start_ns: int, stamps_ns: npt.NDArray[np.int64], T: Floats) -> list[Series]:
    positions_xyz, quats_xyzw = se3.to_pose(T)
    linear, angular = _velocities(stamps_ns, positions_xyz, quats_xyzw)

    def odometry(index: int) -> Odometry:
        return Odometry(
            positions_xyz[index],
            quats_xyzw[index],
            linear_xyz=linear[index],
            angular_xyz=angular[index],
            child_frame_id=BASE,
            header=Header(int(stamps_ns[index]), ODOM),
        )

    moving = moving_series(start_ns, stamps_ns, positions_xyz, quats_xyzw)
    return [*moving, Series("/odom", Odometry, stamps_ns, odometry)]


def _velocities(
    stamps_ns: npt.NDArray[np.int64], positions_xyz: Floats, quats_xyzw: Floats
) -> tuple[Floats, Floats]:
    """Linear and angular (N, 3), in the axes of base_link: between the frames before and after."""
    here = np.arange(len(stamps_ns))
    before, after = np.maximum(here - 1, 0), np.minimum(here + 1, len(here) - 1)
    seconds = np.maximum((stamps_ns[after] - stamps_ns[before]) / _NS, 1e-9)[:, None]
    moved = (positions_xyz[after] - positions_xyz[before]) / seconds
    linear = np.einsum("nji,nj->ni", rotations.to_matrix(quats_xyzw), moved)
    turn = rotations.multiply(rotations.inverse(quats_xyzw[before]), quats_xyzw[after])
    turn = np.where(turn[:, 3:] < 0, -turn, turn)
    sine = np.linalg.norm(turn[:, :3], axis=1, keepdims=True)
    angle = 2 * np.arctan2(sine, turn[:, 3:])
    angular = turn[:, :3] / np.maximum(sine, 1e-12) * angle / seconds
    return linear, angular
