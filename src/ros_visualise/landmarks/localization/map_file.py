"""A map of landmarks as text that can be read again: YAML.

frame_id: map
common_covariance: [36 numbers]   # by what all are off together; 0 where that is not known
landmarks:
- name: tag36h11_3        # the class, and a number where there may be several of it
  class: tag36h11_3
  number: 3               # of the class in messages of ROS 1, -1 for none
  pose:
    position: [x, y, z]   # metres, in the frame above
    orientation: [x, y, z, w]   # null for what has none
    covariance: [36 numbers]    # as PoseWithCovariance has it, row by row, with the common one
  size: [x, y, z]         # metres, 0 where nobody knows
  seen: 12                # how many times

The common covariance is that of a shift of the map, metres, and of a turn about its origin, rad.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ros_visualise.core.errors import OpenError
from ros_visualise.core.yaml_files import MANY_VALUES, BadYaml, load_yaml, to_yaml
from ros_visualise.data import Floats
from ros_visualise.geometry import rotations
from ros_visualise.landmarks.localization.estimate import known
from ros_visualise.landmarks.localization.track import Branch, LandmarkTrack


class MapFile(NamedTuple):
    """What is in a file: the frame, the landmarks, and the covariance (6, 6) common to them."""

    frame_id: str
    landmarks: list[LandmarkTrack]
    common: Floats


def to_text(frame_id: str, landmarks: Iterable[LandmarkTrack], common: Floats | None = None) -> str:
    """The map, with of each landmark the pose that is most likely.

    While another pose may be right, it is in the covariance.
    """
    of_all = np.zeros(36) if common is None else common.ravel()
    several = [_values(one) for one in landmarks]
    return to_yaml(
        {"frame_id": frame_id, "common_covariance": of_all.tolist(), "landmarks": several}
    )


def load(path: Path) -> MapFile:
    """The map that is in a file.

    Raises:
        OpenError: there is no such file, or it is no map; says where it is wrong.
    """
    try:
        values = load_yaml(path, MANY_VALUES)
    except FileNotFoundError:
        raise OpenError.missing(path, "give a map that save_map has written") from None
    except (OSError, BadYaml) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise OpenError(f"{path}: cannot be read as a map of landmarks: {why}") from None
    try:
        frame_id, found = values["frame_id"], values["landmarks"]
        if not isinstance(frame_id, str) or not frame_id or not isinstance(found, list):
            raise ValueError
    except (TypeError, KeyError, ValueError):
        raise OpenError(
            f"{path}: is no map of landmarks: it needs a frame_id and a list of landmarks"
        ) from None
    several = [_track(path, number, one) for number, one in enumerate(found, 1)]
    try:
        common = _covariance(values.get("common_covariance", [0.0] * 36))
    except (TypeError, ValueError) as error:
        raise OpenError(f"{path}: common_covariance of the map is wrong: {error}") from None
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
        estimate = known(_numbers(pose["position"], 3), R, _covariance(pose["covariance"]))
        size, seen = _numbers(values["size"], 3), int(values["seen"])
        return LandmarkTrack(
            str(values["class"]),
            int(values["number"]),
            quat is not None,
            (Branch(estimate, 0.0),),
            last_ns=0,
            size_xyz=size,
            sizes=seen if size.any() else 0,
            seen=seen,
        )
    except (TypeError, KeyError, ValueError, OverflowError) as error:
        missing = isinstance(error, KeyError)
        why = f"it has no {error.args[0]}" if missing else str(error)
        raise OpenError(f"{path}: landmark {number} of the map is wrong: {why}") from None


def _covariance(values: Any) -> Floats:
    """(6, 6); of one that rounding made a little negative, too."""
    covariance = _numbers(values, 36).reshape(6, 6)
    least, most = np.linalg.eigvalsh((covariance + covariance.T) / 2)[[0, -1]]
    if not np.allclose(covariance, covariance.T) or least < -1e-9 * most:
        raise ValueError("covariance: is not symmetric, or negative")
    even: Floats = (covariance + covariance.T) / 2
    return even


def _numbers(values: Any, count: int) -> Floats:
    numbers = np.asarray(values, np.float64)
    if numbers.shape != (count,) or not np.isfinite(numbers).all():
        raise ValueError(f"{count} numbers are needed, not {values!r:.60}")
    return numbers
