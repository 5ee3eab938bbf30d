"""Landmark maps as YAML files.

    frame_id: map
    common_covariance: [36 numbers]   # of the common error of all landmarks; 0 if unknown
    landmarks:
    - name: tag36h11_3        # the class, with a number if there may be several
      class: tag36h11_3
      number: 3               # of the class in messages of ROS 1, -1 for none
      pose:
        position: [x, y, z]   # metres, in the frame above
        orientation: [x, y, z, w]   # null without an orientation
        covariance: [36 numbers]    # row by row as in PoseWithCovariance, including the common one
      size: [x, y, z]         # metres, 0 if unknown
      seen: 12                # number of sightings

The common covariance is that of a translation of the map, metres, and of a rotation about its
origin, rad.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ros_visualise.core.errors import OpenError
from ros_visualise.core.yaml_files import MANY_VALUES, open_yaml, to_yaml
from ros_visualise.data import Floats
from ros_visualise.estimation.localization.track import LandmarkTrack
from ros_visualise.geometry import rotations


class MapFile(NamedTuple):
    """Contents of a file: the frame, the landmarks, and their common covariance (6, 6)."""

    frame_id: str
    landmarks: list[LandmarkTrack]
    common: Floats


def to_text(frame_id: str, landmarks: Iterable[LandmarkTrack], common: Floats | None = None) -> str:
    """The map, with the most likely pose of each landmark.

    While another pose is possible, the covariance includes it.
    """
    of_all = np.zeros(36) if common is None else common.ravel()
    several = [_values(one) for one in landmarks]
    return to_yaml(
        {"frame_id": frame_id, "common_covariance": of_all.tolist(), "landmarks": several}
    )


def load(path: Path) -> MapFile:
    """Read a map.

    Raises:
        OpenError: the file is missing or not a valid map.
    """
    values = open_yaml(path, "give a map written by save_map", MANY_VALUES)
    try:
        frame_id, found = values["frame_id"], values["landmarks"]
        if not isinstance(frame_id, str) or not frame_id or not isinstance(found, list):
            raise ValueError
    except (TypeError, KeyError, ValueError):
        raise OpenError(
            f"{path}: not a landmark map: needs a frame_id and a list of landmarks"
        ) from None
    several = [_track(path, number, one) for number, one in enumerate(found, 1)]
    try:
        common = _covariance(values.get("common_covariance", [0.0] * 36))
    except (TypeError, ValueError) as error:
        raise OpenError(f"{path}: invalid common_covariance: {error}") from None
    return MapFile(frame_id, several, common)


def _values(track: LandmarkTrack) -> dict[str, Any]:
    quat = rotations.from_matrix(track.best.R_fixed_landmark).tolist()
    return {
        "name": track.name,
        "class": track.class_id,
        "number": track.class_number,
        "pose": {
            "position": track.best.position_xyz.tolist(),
            "orientation": quat if track.turned else None,
            "covariance": track.covariance.ravel().tolist(),
        },
        "size": track.size_xyz.tolist(),
        "seen": track.seen,
    }


def _track(path: Path, number: int, values: Any) -> LandmarkTrack:
    try:
        pose, quat = values["pose"], values["pose"]["orientation"]
        R = np.eye(3) if quat is None else rotations.to_matrix(_numbers(quat, 4))
        at = _numbers(pose["position"], 3), R, _covariance(pose["covariance"])
        size, seen = _numbers(values["size"], 3), int(values["seen"])
        of_class = str(values["class"]), int(values["number"])
        return LandmarkTrack.of_map(of_class, at, size, seen, turned=quat is not None)
    except (TypeError, KeyError, ValueError, OverflowError) as error:
        missing = isinstance(error, KeyError)
        why = f"missing {error.args[0]}" if missing else str(error)
        raise OpenError(f"{path}: landmark {number} is invalid: {why}") from None


def _covariance(values: Any) -> Floats:
    """(6, 6); tolerates slightly negative eigenvalues from rounding."""
    covariance = _numbers(values, 36).reshape(6, 6)
    least, most = np.linalg.eigvalsh((covariance + covariance.T) / 2)[[0, -1]]
    if not np.allclose(covariance, covariance.T) or least < -1e-9 * most:
        raise ValueError("covariance: must be symmetric and not negative")
    even: Floats = (covariance + covariance.T) / 2
    return even


def _numbers(values: Any, count: int) -> Floats:
    numbers = np.asarray(values, np.float64)
    if numbers.shape != (count,) or not np.isfinite(numbers).all():
        raise ValueError(f"give {count} numbers, not {values!r:.60}")
    return numbers
