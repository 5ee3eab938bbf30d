"""A drive of KITTI's raw data, synced and rectified or neither, with whatever sensors it has."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import OpenError
from ros_visualise.data import CameraInfo, Floats, Header, Image, PointCloud, TimeReference
from ros_visualise.geometry import transforms
from ros_visualise.sources.kitti import calibration, oxts, sensors, stamps
from ros_visualise.sources.kitti.calibration import CalibrationFile
from ros_visualise.sources.kitti.files import (
    CAMERAS,
    PARTS,
    Files,
    add_damage,
    add_missing,
    is_unsynced,
    list_files,
)
from ros_visualise.sources.kitti.sensors import (
    BASE,
    IMU,
    MAP,
    ODOM,
    VELODYNE,
    Scanner,
    optical_frame,
    static_series,
)
from ros_visualise.sources.recordings import Loss
from ros_visualise.sources.recordings.series import SeriesRecording
from ros_visualise.sources.series import DamagedFile, Series

_OXTS_TOPICS = 5  # messages of one sample: imu, fix, vel, odom, tf
_RAW_SIZE = (1392, 512)
_FIRST_DAY = "2011_09_26"
_MS = 1_000_000
_LACKING = {
    "cam_to_cam": "no camera has its camera_info and its frame",
    "velo_to_cam": "no camera has its frame",
    "imu_to_velo": "the scanner and the cameras are not connected to base_link",
}
"""What is left out without a file."""

Places = list[tuple[str, str, Floats]]


@dataclass
class _Drive:
    folder: Path
    scans: Files
    samples: Files
    images: dict[int, Files]
    notes: list[str] = field(default_factory=list)
    loss: Loss = field(default_factory=Loss)

    @property
    def parts(self) -> dict[str, Files]:
        """Those that hold frames, by the names of their folders, the best for times first."""
        images = {f"image_{camera:02d}": files for camera, files in self.images.items()}
        every = {"velodyne_points": self.scans, "oxts": self.samples, **images}
        return {name: files for name, files in every.items() if files}

    def lose(self, error: DamagedFile, messages: int = 0) -> None:
        """Say that a file beside the frames is damaged, and so many messages are left out."""
        add_damage(self.loss, self.folder, error, messages)


def open_drive(folder: Path) -> SeriesRecording:
    """The recording of a drive's folder.

    Raises:
        OpenError: it holds no frames.
    """
    samples = list_files(folder / "oxts" / "data", "txt")
    scans = list_files(folder / "velodyne_points" / "data", "bin", "txt")
    images = {c: list_files(folder / f"image_{c:02d}" / "data", "png") for c in CAMERAS}
    drive = _Drive(folder, scans, samples, {c: files for c, files in images.items() if files})
    if not drive.parts:
        raise OpenError(f"{folder}: holds no frames that can be read; unpack the drive again")
    _say_empty(drive)
    unsynced = _is_unsynced(drive)
    times = _stamp(drive, synced=not unsynced)
    start_ns = min(int(one.min()) for one in times.values())
    series, places = [], []
    whole, rows, damaged = oxts.read_samples(samples)
    if whole:
        found = oxts.Samples(rows, times["oxts"][whole])
        series += found.series(start_ns)
        places.append((MAP, ODOM, np.eye(4)))
    sensors, fixed = _sensors(drive, times, unsynced)
    series = [static_series(start_ns, places + fixed), *series, *sensors]
    size = sum(files.size for files in drive.parts.values())
    lost: list[tuple[DamagedFile, int]] = [(error, _OXTS_TOPICS) for error in damaged]
    return SeriesRecording(folder, "KITTI raw", size, series, drive.notes, lost, drive.loss)


def _say_empty(drive: _Drive) -> None:
    """Say which sensors' folders have no frames; those that their times count are missing."""
    for name in sorted(PARTS - drive.parts.keys()):
        data = drive.folder / name / "data"
        if data.exists() and not os.access(data, os.R_OK | os.X_OK):
            drive.lose(DamagedFile(data, "you may not read it; try chmod u+rX"))
        elif times := stamps.read_times(data.with_name("timestamps.txt"), stamps.parse_time):
            add_missing(drive.loss, name, 0, len(times))
        elif data.parent.is_dir():
            drive.notes.append(f"{name}: holds no frames; unpack it again if it should")


def _is_unsynced(drive: _Drive) -> bool:
    """By its name; else by the size of its images."""
    told = is_unsynced(drive.folder)
    if told is not None:
        return told
    sizes = [sensors.first_size(files) for files in drive.images.values()]
    return _RAW_SIZE in sizes


def _stamp(drive: _Drive, synced: bool) -> dict[str, npt.NDArray[np.int64]]:
    """The times of each part's frames."""
    sensors = [
        stamps.read_stamps(name, drive.folder / name / "timestamps.txt", files.numbers)
        for name, files in drive.parts.items()
    ]
    for one in sensors:
        add_missing(drive.loss, one.name, len(one.numbers), one.missing + len(one.numbers))
    periods_ns = {one.name: 100 * _MS for one in sensors}
    if not synced:
        periods_ns["oxts"] = 10 * _MS
    notes, damaged = stamps.complete(sensors, synced, _date_ns(drive.folder), periods_ns)
    drive.notes += notes
    for error in damaged:
        drive.lose(error)
    return {
        one.name: np.array([one.times[number] for number in one.numbers], np.int64)
        for one in sensors
    }


def _date_ns(folder: Path) -> int:
    """The start of the day that the folder's name begins with."""
    found = re.search(r"(\d{4})_(\d\d)_(\d\d)", str(folder.absolute()))
    year, month, day = found.groups() if found else _FIRST_DAY.split("_")
    return stamps.parse_time(f"{year}-{month}-{day} 00:00:00") or 0


def _sensors(
    drive: _Drive, times: dict[str, npt.NDArray[np.int64]], unsynced: bool
) -> tuple[list[Series], Places]:
    """The scanner's and the cameras' topics, and where the sensors are."""
    places: Places = [(BASE, IMU, oxts.T_BASE_IMU)]
    if drive.images or drive.scans:
        imu_to_velo = _read_calibration(drive, "imu_to_velo")
        T_velodyne_imu = calibration.rigid(imu_to_velo, [f"{IMU} -> {VELODYNE}"])
        if T_velodyne_imu is not None:
            places.append((IMU, VELODYNE, transforms.inverse(T_velodyne_imu)))
        _say_damage(drive, imu_to_velo)
    series = []
    if drive.scans:
        stamps_ns = times["velodyne_points"]
        scanner = Scanner(drive.scans, stamps_ns, VELODYNE)
        series.append(Series("/velodyne_points", PointCloud, stamps_ns, scanner.cloud, slow=True))
        series += [_turn(drive, stamps_ns, what) for what in ("start", "end")]
    found_series, found_places = _cameras(drive, times, unsynced) if drive.images else ([], [])
    return [*series, *found_series], [*places, *found_places]


def _cameras(
    drive: _Drive, times: dict[str, npt.NDArray[np.int64]], unsynced: bool
) -> tuple[list[Series], Places]:
    """The cameras' topics, and where they are."""
    series, places = [], []
    cam_to_cam = _read_calibration(drive, "cam_to_cam")
    velo_to_cam = _read_calibration(drive, "velo_to_cam")
    T_cam0_velodyne = calibration.rigid(velo_to_cam, [optical_frame(n) for n in drive.images])
    for number, files in drive.images.items():
        found = calibration.raw_camera(
            number, cam_to_cam, T_cam0_velodyne, not unsynced, len(files)
        )
        _check(drive, number, found)
        stamps_ns = times[f"image_{number:02d}"]
        name = "image_raw" if unsynced else "image_rect"
        series += camera_series(number, name, files, stamps_ns, found.info)
        if found.T_velodyne_camera is not None:
            places.append((VELODYNE, optical_frame(number), found.T_velodyne_camera))
    _say_damage(drive, cam_to_cam)
    _say_damage(drive, velo_to_cam)
    return series, places


def _turn(drive: _Drive, stamps_ns: npt.NDArray[np.int64], what: str) -> Series:
    """When each turn of the scanner began, or ended; of those of which it is told."""
    path = drive.folder / "velodyne_points" / f"timestamps_{what}.txt"
    numbers, topic = drive.scans.numbers, f"/velodyne_points/scan_{what}"
    told = stamps.read_stamps("velodyne_points", path, numbers)
    times = told.times
    if told.lacking and path.exists():
        why = f"{told.gaps}; left out: so many messages of {topic}"
        drive.lose(DamagedFile(path, why), len(told.lacking))
    elif told.lacking and path.with_name("timestamps.txt").exists():
        drive.notes.append(f"velodyne_points: no {path.name}, so without {topic}")
    known = [(index, times[number]) for index, number in enumerate(numbers) if number in times]
    of_scans = np.array([stamps_ns[index] for index, _ in known], np.int64)

    def make(index: int) -> TimeReference:
        header = Header(int(of_scans[index]), VELODYNE)
        return TimeReference(known[index][1], f"{what} of the scan", header)

    return Series(topic, TimeReference, of_scans, make)


def camera_series(
    number: int,
    name: str,
    files: Files,
    stamps_ns: npt.NDArray[np.int64],
    info: CameraInfo | None,
) -> list[Series]:
    """A camera's images and, where it is calibrated, what goes with them."""
    room = f"/cam{number:02d}"
    camera = sensors.Camera(files, stamps_ns, number >= 2, optical_frame(number), info)
    series = [Series(f"{room}/{name}", Image, stamps_ns, camera.image, slow=True)]
    if info is not None:
        series.append(Series(f"{room}/camera_info", CameraInfo, stamps_ns, camera.info))
    return series


def _read_calibration(drive: _Drive, name: str) -> CalibrationFile:
    """A calibration file beside the drive's folder or in it."""
    folders = (drive.folder.absolute().parent, drive.folder)
    paths = [folder / f"calib_{name}.txt" for folder in folders]
    found = next((path for path in paths if path.exists()), None)
    if found is None:
        drive.notes.append(f"no {paths[0].name} in {folders[0]}: {_LACKING[name]}")
    return CalibrationFile(found)


def _say_damage(drive: _Drive, file: CalibrationFile) -> None:
    if error := file.damage():
        drive.lose(error, file.messages)


def _check(drive: _Drive, number: int, camera: calibration.Camera) -> None:
    if camera.info is None:
        return
    size = sensors.first_size(drive.images[number])
    calibrated = (camera.info.width, camera.info.height)
    if all(size) and size != calibrated:
        (w, h), (cw, ch) = size, calibrated
        drive.notes.append(f"image_{number:02d}: images of {w}x{h}, calibrated for {cw}x{ch}")
