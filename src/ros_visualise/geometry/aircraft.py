"""Axes of aircraft (north, east, down; forward, right, down) and of ROS (REP 103)."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats
from ros_visualise.geometry import rotations

_ENU_NED = np.array([np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0])  # half a turn about north-east
_FRD_FLU = np.array([1.0, 0.0, 0.0, 0.0])  # half a turn about forward


def to_enu(ned: npt.ArrayLike) -> Floats:
    """Vectors (..., 3) of the world."""
    north, east, down = np.moveaxis(np.asarray(ned, np.float64), -1, 0)
    return np.stack([east, north, -down], axis=-1)


def to_flu(frd: npt.ArrayLike) -> Floats:
    """Vectors (..., 3) of the body."""
    return np.asarray(frd, np.float64) * [1.0, -1.0, -1.0]


def R_body_camera(below_deg: float) -> Floats:  # noqa: N802
    """(3, 3) optical axes of a camera that looks forward and so much below the horizon."""
    sine, cosine = math.sin(math.radians(below_deg)), math.cos(math.radians(below_deg))
    return np.array([[0, -sine, cosine], [-1, 0, 0], [0, -cosine, -sine]])


def to_attitude(quat_wxyz: npt.ArrayLike) -> Floats:
    """Quaternions x, y, z, w (..., 4) of FLU in ENU, of w, x, y, z of FRD in NED."""
    quat_xyzw = np.roll(np.asarray(quat_wxyz, np.float64), -1, axis=-1)
    turned = rotations.multiply(rotations.multiply(_ENU_NED, quat_xyzw), _FRD_FLU)
    return rotations.normalise(turned)
