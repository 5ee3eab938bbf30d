"""Sequences of EuRoC's and TUM-VI's data sets: cameras and an IMU, in the format of ETH's ASL.

Topics are ``/cam00/image_raw`` and ``/cam00/camera_info``, ``/cam01`` likewise, ``/imu/data``,
``/ground_truth/odom`` (without velocities) and ``/tf_static``, with the frames base_link ->
imu_link and ``cam00_optical``. base_link is the body of the data set, which is its IMU.

Below ``mav0`` a folder for each sensor has a table ``data.csv``, stamps in nanoseconds, and its
calibration ``sensor.yaml``, with T_BS: the pose of the sensor in the body. TUM-VI has its
calibration, by Kalibr, in ``dso/camchain.yaml``, which goes first. Ground truth is in
``state_groundtruth_estimate0`` or, as TUM-VI has it, in ``mocap0``.

Source: M. Burri et al., The EuRoC micro aerial vehicle datasets, IJRR 2016; D. Schubert et al., The
TUM VI benchmark for evaluating visual-inertial odometry, IROS 2018.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import OpenError
from ros_visualise.core.yaml_files import BadYaml, load_yaml
from ros_visualise.data import CameraInfo, Floats, Header, Imu, Odometry
from ros_visualise.geometry import se3
from ros_visualise.sources.kitti.files import Findings, FrameFiles, read_lines
from ros_visualise.sources.kitti.sensors import (
    BASE,
    IMU,
    MAP,
    Places,
    camera_series,
    optical_frame,
    static_series,
)
from ros_visualise.sources.recordings.series import SeriesRecording
from ros_visualise.sources.series import DamagedFile, Series

_CAMERAS = range(2)
_TRUTHS = ("state_groundtruth_estimate0", "mocap0")
_TABLE, _SENSOR, _CHAIN = "data.csv", "sensor.yaml", "camchain.yaml"
_MODELS = {
    "radial-tangential": "plumb_bob",
    "radtan": "plumb_bob",
    "equidistant": "equidistant",
    "none": "plumb_bob",
}
"""Models of distortion, as the data sets and ROS name them."""
_DEPTH = 3  # of mav0/cam0/data in a sequence

_Stamps = npt.NDArray[np.int64]


def is_whole(folder: Path) -> bool:
    """True for a sequence, and for its folder ``mav0``."""
    return _body_of(folder) is not None


def find_whole(part: Path) -> Path | None:
    """The sequence that a folder belongs to, if any."""
    above = part.absolute().parents[:_DEPTH]
    return next((one for one in above if one.name != "mav0" and is_whole(one)), None)


def _body_of(folder: Path) -> Path | None:
    """The folder of the sensors."""
    for one in (folder / "mav0", folder):
        if any((one / name / _TABLE).is_file() for name in ("cam0", "imu0")):
            return one
    return None


def open_euroc(folder: Path) -> SeriesRecording:
    """The recording of a sequence; raises OpenError if it has neither images nor an IMU."""
    body, findings = _body_of(folder), Findings(folder)
    assert body is not None
    places: Places = []
    series: list[Series] = []
    chain = _values(body.parent / "dso" / _CHAIN, findings)
    size = 0
    for number in _CAMERAS:
        room = body / f"cam{number}"
        files, stamps_ns = _images(room, findings)
        if not len(files):
            continue
        info, T = _calibration(chain.get(f"cam{number}"), room, findings)
        series += camera_series(number, "image_raw", files, stamps_ns, info)
        places += [(BASE, optical_frame(number), T)] if T is not None else []
        size += files.size
    series += [*_imu(body / "imu0", places, findings), *_truth(body, findings)]
    if not series:
        raise OpenError(f"{folder}: no images and no measurements; unpack the data set there again")
    start_ns = min(int(one.stamps_ns.min()) for one in series)
    series = [static_series(start_ns, places), *series] if places else series
    notes, loss = findings.notes, findings.loss
    return SeriesRecording(folder, "EuRoC", size, series, notes, loss=loss)


def _table(path: Path, columns: int, findings: Findings) -> tuple[_Stamps, Floats]:
    """Stamps (N,) and the next columns (N, C) of a table; lines that are damaged are skipped."""
    stamps, rows, damaged = [], [], 0
    try:
        lines = read_lines(path)
    except DamagedFile as error:
        findings.lose(error)
        lines = []
    for line in lines:
        if not line.strip() or line.startswith("#"):
            continue
        first, *others = line.split(",")
        try:
            row = [float(one) for one in others[:columns]]
            stamp_ns = int(first)
        except ValueError:
            row, stamp_ns = [], -1
        if len(row) == columns and np.isfinite(row).all() and 0 <= stamp_ns < 1 << 63:
            stamps.append(stamp_ns)
            rows.append(row)
        else:
            damaged += 1
    if damaged:
        why = f"{damaged} of {damaged + len(rows)} lines are damaged; skipped"
        findings.lose(DamagedFile(path, why, size=0), damaged)
    return np.array(stamps, np.int64), np.array(rows, np.float64).reshape(len(rows), columns)


def _images(room: Path, findings: Findings) -> tuple[FrameFiles, _Stamps]:
    """The images of a camera that its table lists, by its names of files."""
    table, folder = room / _TABLE, room / "data"
    if not table.is_file():
        return FrameFiles(folder), np.zeros(0, np.int64)
    stamps_ns, _ = _table(table, 0, findings)
    with suppress(DamagedFile):
        listed = [line.split(",") for line in read_lines(table) if not line.startswith("#")]
        named = {one[0].strip(): one[1].strip() for one in listed if len(one) > 1}
    names = [named.get(str(one)) or f"{one}.png" for one in stamps_ns.tolist()]
    sizes: dict[str, int] = {}
    with suppress(OSError), os.scandir(folder) as items:
        sizes = {item.name: item.stat().st_size for item in items if item.is_file()}
    there = [n for n, name in enumerate(names) if name in sizes]
    findings.compare(room.name, len(there), len(names))
    kept = tuple(names[n] for n in there)
    files = FrameFiles(folder, kept, tuple(there), sum(sizes[name] for name in kept))
    return files, stamps_ns[there]


def _values(path: Path, findings: Findings) -> Mapping[str, Any]:
    """The values of a YAML file; none if it is missing or damaged."""
    if not path.is_file():
        return {}
    try:
        found = load_yaml(path)
    except (OSError, BadYaml) as error:
        findings.lose(DamagedFile(path, str(error)))
        return {}
    return found if isinstance(found, Mapping) else {}


def _calibration(
    chained: Any, room: Path, findings: Findings
) -> tuple[CameraInfo | None, Floats | None]:
    """A camera's calibration, and T_body_camera; None where it is missing or wrong."""
    values = chained if isinstance(chained, Mapping) else _values(room / _SENSOR, findings)
    if not values:
        findings.notes.append(f"{room.name}: no calibration ({_SENSOR} or dso/{_CHAIN})")
        return None, None
    try:
        return _info(values), _pose(values)
    except (KeyError, TypeError, ValueError) as error:
        findings.notes.append(f"{room.name}: its calibration is not used: {error!r}")
        return None, None


def _info(values: Mapping[str, Any]) -> CameraInfo:
    """Raises KeyError, TypeError or ValueError."""
    if values["camera_model"] != "pinhole" or values["distortion_model"] not in _MODELS:
        raise ValueError(f"camera model {values['camera_model']}, {values['distortion_model']}")
    fu, fv, cu, cv = (float(one) for one in values["intrinsics"])
    width, height = (int(one) for one in values["resolution"])
    key = "distortion_coefficients" if "distortion_coefficients" in values else "distortion_coeffs"
    D = np.array(values[key], np.float64)
    K = np.array([[fu, 0, cu], [0, fv, cv], [0, 0, 1]])
    if not (np.isfinite(K).all() and np.isfinite(D).all() and min(fu, fv, width, height) > 0):
        raise ValueError("not finite, or not positive")
    return CameraInfo(height, width, K, D, distortion_model=_MODELS[values["distortion_model"]])


def _pose(values: Mapping[str, Any]) -> Floats | None:
    """T_body_sensor; None if it is not given. Raises ValueError."""
    if "T_cam_imu" in values:
        T = np.array(values["T_cam_imu"], np.float64).reshape(4, 4)
    elif "T_BS" in values:
        T = np.array(values["T_BS"]["data"], np.float64).reshape(4, 4)
    else:
        return None
    R = T[:3, :3]
    if not (np.isfinite(T).all() and np.allclose(R @ R.T, np.eye(3), atol=1e-3)):
        raise ValueError("the pose of the camera is not a rigid transform")
    return se3.inverse(T) if "T_cam_imu" in values else T


def _imu(room: Path, places: Places, findings: Findings) -> list[Series]:
    if not (room / _TABLE).is_file():
        return []
    stamps_ns, values = _table(room / _TABLE, 6, findings)
    try:
        T = _pose(_values(room / _SENSOR, findings))
    except (KeyError, TypeError, ValueError):
        T = None
    places.append((BASE, IMU, np.eye(4) if T is None else T))
    attitude, none = np.array([0.0, 0, 0, 1]), np.diag([-1.0, 0, 0])

    def imu(index: int) -> Imu:
        header = Header(int(stamps_ns[index]), IMU)
        return Imu(attitude, values[index, :3], values[index, 3:], none, header=header)

    return [Series("/imu/data", Imu, stamps_ns, imu)] if len(stamps_ns) else []


def _truth(body: Path, findings: Findings) -> list[Series]:
    """Poses of the body; quaternions are w, x, y, z in the files."""
    found = next((one for one in _TRUTHS if (body / one / _TABLE).is_file()), None)
    if found is None:
        return []
    stamps_ns, values = _table(body / found / _TABLE, 7, findings)

    def odometry(index: int) -> Odometry:
        x, y, z, qw, qx, qy, qz = values[index].tolist()
        header = Header(int(stamps_ns[index]), MAP)
        quat = np.array([qx, qy, qz, qw])
        return Odometry(np.array([x, y, z]), quat, child_frame_id=BASE, header=header)

    return [Series("/ground_truth/odom", Odometry, stamps_ns, odometry)] if len(stamps_ns) else []
