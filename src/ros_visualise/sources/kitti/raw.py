"""A drive of KITTI's raw data, synced and rectified or neither, with whatever sensors it has."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import OpenError
from ros_visualise.data import Header, TimeReference
from ros_visualise.geometry import se3
from ros_visualise.sources.kitti import calibration, oxts, sensors, stamps
from ros_visualise.sources.kitti.calibration import CalibrationFile
from ros_visualise.sources.kitti.files import CAMERAS, PARTS, Findings, FrameFiles, list_files
from ros_visualise.sources.kitti.sensors import (
    BASE,
    IMU,
    MAP,
    ODOM,
    VELODYNE,
    Places,
    camera_series,
    optical_frame,
    scanner_series,
    static_series,
)
from ros_visualise.sources.recordings.series import SeriesRecording
from ros_visualise.sources.series import DamagedFile, Series

_OXTS_TOPICS = 5  # messages of one sample: imu, fix, vel, odom, tf
_RAW_SIZE = (1392, 512)
_FIRST_DAY = "2011_09_26"
_MS = 1_000_000
_LACKING = {
    "cam_to_cam": "the cameras have no camera_info and no tf frames",
    "velo_to_cam": "the cameras have no frames",
    "imu_to_velo": "the scanner and the cameras are not connected to base_link",
}
"""Effect of a missing calibration file."""

_Times = dict[str, npt.NDArray[np.int64]]


@dataclass
class _Drive(Findings):
    """The files of a drive."""

    def __post_init__(self) -> None:
        self.samples = list_files(self.folder / "oxts" / "data", "txt")
        self.scans = list_files(self.folder / "velodyne_points" / "data", "bin", "txt")
        images = {c: list_files(self.folder / f"image_{c:02d}" / "data", "png") for c in CAMERAS}
        self.images = {camera: files for camera, files in images.items() if files}

    @property
    def parts(self) -> dict[str, FrameFiles]:
        """The sensors with frames by the names of their folders, the best for times first."""
        images = {f"image_{camera:02d}": files for camera, files in self.images.items()}
        every = {"velodyne_points": self.scans, "oxts": self.samples, **images}
        return {name: files for name, files in every.items() if files}


def open_drive(folder: Path) -> SeriesRecording:
    """The recording of a drive's folder; raises OpenError if it holds no frames."""
    drive = _Drive(folder)
    if not drive.parts:
        raise OpenError(f"{folder}: holds no readable frames; unpack the drive again")
    _report_empty(drive)
    unsynced = _is_unsynced(drive)
    times = _stamp(drive, synced=not unsynced)
    start_ns = min(int(one.min()) for one in times.values())
    series: list[Series] = []
    places: Places = []
    whole, rows, damaged = oxts.read_samples(drive.samples)
    if whole:
        series += oxts.OxtsSamples(rows, times["oxts"][whole]).series(start_ns)
        places.append((MAP, ODOM, np.eye(4)))
    more, fixed = _sensors(drive, times, unsynced)
    series = [static_series(start_ns, places + fixed), *series, *more]
    size = sum(files.size for files in drive.parts.values())
    lost: list[tuple[DamagedFile, int]] = [(error, _OXTS_TOPICS) for error in damaged]
    return SeriesRecording(folder, "KITTI raw", size, series, drive.notes, lost, drive.loss)


def _report_empty(drive: _Drive) -> None:
    """Note the sensors' folders without frames; those that their times count are missing."""
    for name in sorted(PARTS - drive.parts.keys()):
        data = drive.folder / name / "data"
        if data.exists() and not os.access(data, os.R_OK | os.X_OK):
            drive.lose(DamagedFile(data, "permission denied; try chmod u+rX"))
        elif times := stamps.read_times(data.with_name("timestamps.txt"), stamps.parse_time):
            drive.compare(name, 0, len(times))
        elif data.parent.is_dir():
            drive.notes.append(f"{name}: holds no frames; unpack it again if it should have some")


def _is_unsynced(drive: _Drive) -> bool:
    """True if it is neither synchronised nor rectified: by its name, else by its images' size."""
    found = re.search(r"_(sync|extract)\b", drive.folder.absolute().name)
    if found is not None:
        return found[1] == "extract"
    return _RAW_SIZE in [sensors.first_size(files) for files in drive.images.values()]


def _stamp(drive: _Drive, synced: bool) -> _Times:
    """The times of each part's frames."""
    parts = [
        stamps.read_stamps(name, drive.folder / name / "timestamps.txt", files.numbers)
        for name, files in drive.parts.items()
    ]
    for one in parts:
        drive.compare(one.name, len(one.numbers), one.more + len(one.numbers))
    periods_ns = {one.name: 100 * _MS for one in parts}
    if not synced:
        periods_ns["oxts"] = 10 * _MS
    day = re.search(r"\d{4}_\d\d_\d\d", str(drive.folder.absolute()))
    date = (day[0] if day else _FIRST_DAY).replace("_", "-")
    start_ns = stamps.parse_time(f"{date} 00:00:00") or 0
    times, damaged = stamps.complete(parts, drive.notes, synced, start_ns, periods_ns)
    for error in damaged:
        drive.lose(error)
    return times


def _sensors(drive: _Drive, times: _Times, unsynced: bool) -> tuple[list[Series], Places]:
    """The scanner's and the cameras' topics, and the frames of all sensors."""
    series: list[Series] = []
    places: Places = [(BASE, IMU, oxts.T_BASE_IMU)]
    if drive.images or drive.scans:
        imu_to_velo = _read_calibration(drive, "imu_to_velo")
        T_velodyne_imu = calibration.rigid(imu_to_velo, [f"{IMU} -> {VELODYNE}"])
        if T_velodyne_imu is not None:
            places.append((IMU, VELODYNE, se3.inverse(T_velodyne_imu)))
        imu_to_velo.report(drive)
    if drive.scans:
        stamps_ns = times["velodyne_points"]
        series.append(scanner_series(drive.scans, stamps_ns))
        series += [_turn(drive, stamps_ns, what) for what in ("start", "end")]
    if drive.images:
        found_series, found_places = _cameras(drive, times, unsynced)
        series, places = [*series, *found_series], [*places, *found_places]
    return series, places


def _cameras(drive: _Drive, times: _Times, unsynced: bool) -> tuple[list[Series], Places]:
    """The cameras' topics and frames."""
    series, places = [], []
    cam_to_cam = _read_calibration(drive, "cam_to_cam")
    velo_to_cam = _read_calibration(drive, "velo_to_cam")
    T_cam0_velodyne = calibration.rigid(velo_to_cam, [optical_frame(n) for n in drive.images])
    for number, files in drive.images.items():
        found = calibration.raw_camera(
            number, cam_to_cam, T_cam0_velodyne, not unsynced, len(files)
        )
        if found.info is not None:
            size, calibrated = sensors.first_size(files), (found.info.width, found.info.height)
            if all(size) and size != calibrated:
                (w, h), (cw, ch) = size, calibrated
                note = f"image_{number:02d}: images of {w}x{h}, calibrated for {cw}x{ch}"
                drive.notes.append(note)
        stamps_ns = times[f"image_{number:02d}"]
        name = "image_raw" if unsynced else "image_rect"
        series += camera_series(number, name, files, stamps_ns, found.info)
        if found.T_velodyne_camera is not None:
            places.append((VELODYNE, optical_frame(number), found.T_velodyne_camera))
    cam_to_cam.report(drive)
    velo_to_cam.report(drive)
    return series, places


def _turn(drive: _Drive, stamps_ns: npt.NDArray[np.int64], what: str) -> Series:
    """The start, or the end, of each turn of the scanner, as far as the times are known."""
    path = drive.folder / "velodyne_points" / f"timestamps_{what}.txt"
    numbers, topic = drive.scans.numbers, f"/velodyne_points/scan_{what}"
    found = stamps.read_stamps("velodyne_points", path, numbers)
    times = found.times
    if found.lacking and path.exists():
        why = f"{found.gaps}; their messages on {topic} skipped"
        drive.lose(DamagedFile(path, why), len(found.lacking))
    elif found.lacking and path.with_name("timestamps.txt").exists():
        drive.notes.append(f"velodyne_points: no {path.name}, so {topic} is missing")
    known = [(index, times[number]) for index, number in enumerate(numbers) if number in times]
    of_scans = np.array([stamps_ns[index] for index, _ in known], np.int64)

    def make(index: int) -> TimeReference:
        header = Header(int(of_scans[index]), VELODYNE)
        return TimeReference(known[index][1], f"{what} of the scan", header)

    return Series(topic, TimeReference, of_scans, make)


def _read_calibration(drive: _Drive, name: str) -> CalibrationFile:
    """A calibration file beside the drive's folder or in it."""
    folders = (drive.folder.absolute().parent, drive.folder)
    paths = [folder / f"calib_{name}.txt" for folder in folders]
    found = next((path for path in paths if path.exists()), None)
    if found is None:
        drive.notes.append(f"no {paths[0].name} in {folders[0]}: {_LACKING[name]}")
    return CalibrationFile(found)
