"""The robot's own part of the state: pose, motion, and the errors of its sensors.

Its pose, velocity and previous pose change with the map as a whole, all by one twist
(`ros_visualise.geometry.se3`); so does the GPS origin. Whatever a sensor adds, such as a bias, are
`OwnStates`, which its file asks for. States that no sensor measures keep their value and prior.

Source: A. Barrau, S. Bonnabel, The invariant extended Kalman filter as a stable observer, 2017 (the
errors of pose and velocity).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.geometry import se3

POSE = slice(0, 6)
VELOCITY = slice(6, 9)
BEFORE = slice(9, 15)
GRAVITY = slice(15, 17)
DATUM = slice(17, 21)
_SHARED = 21

GRAVITY_MS2 = 9.80665
YAW = [0, 1, 2, 5]  # of a twist: the unknowns of a level frame


@dataclass(frozen=True, eq=False)
class OwnStates:
    """States of one sensor, such as its bias: their place in errors and in `RobotState.own`."""

    rows: slice
    place: slice


_own: dict[str, OwnStates] = {}


def own_states(name: str, size: int) -> OwnStates:
    """Place for the states of a sensor; asked for when its file is imported."""
    if name not in _own:
        start = core() - _SHARED
        place = slice(start, start + size)
        _own[name] = OwnStates(slice(_SHARED + place.start, _SHARED + place.stop), place)
    return _own[name]


def core() -> int:
    """Number of the robot's states."""
    return next(reversed(_own.values())).rows.stop if _own else _SHARED


def _zeros() -> Floats:
    return np.zeros(3)


@dataclass(frozen=True, eq=False)
class RobotState:
    """The robot at one time.

    Attributes:
        R, p: T_map_base, (3, 3) and (3,).
        v: (3,) velocity, m/s in the map.
        rates: (3,) angular velocity, rad/s in the map, as last measured.
        before_R, before_p: pose at the previous odometry message, where its next motion starts.
        gravity: (3,) m/s^2 in the map; the errors of its first two components are the map's tilt.
        datum_R, datum_p: T_map_enu, the GPS origin.
        own: states of the sensors, see `own_states`.
    """

    R: Floats = field(default_factory=lambda: np.eye(3))
    p: Floats = field(default_factory=_zeros)
    v: Floats = field(default_factory=_zeros)
    rates: Floats = field(default_factory=_zeros)
    before_R: Floats = field(default_factory=lambda: np.eye(3))
    before_p: Floats = field(default_factory=_zeros)
    gravity: Floats = field(default_factory=lambda: np.array([0.0, 0, -GRAVITY_MS2]))
    datum_R: Floats = field(default_factory=lambda: np.eye(3))
    datum_p: Floats = field(default_factory=_zeros)
    own: Floats = field(default_factory=lambda: np.zeros(core() - _SHARED))

    def __getitem__(self, states: OwnStates) -> Floats:
        """The values of a sensor's states."""
        values: Floats = self.own[states.place]
        return values

    def with_own(self, states: OwnStates, values: Floats) -> RobotState:
        """The same with other values of a sensor's states."""
        own = self.own.copy()
        own[states.place] = values
        return replace(self, own=own)

    def standing(self) -> RobotState:
        """The same, with the present pose as the previous one."""
        return replace(self, before_R=self.R, before_p=self.p)

    def moved(self, error: Floats) -> RobotState:
        """The same, corrected by an error (core(),)."""
        twists = np.zeros((4, 6))
        twists[0], twists[1] = error[POSE], error[BEFORE]
        twists[2, YAW] = error[DATUM]
        twists[3, :3], twists[3, 3:] = error[VELOCITY], error[3:6]
        R, p = se3.moved(
            twists,
            np.array([self.R, self.before_R, self.datum_R, self.R]),
            np.array([self.p, self.before_p, self.datum_p, self.v]),
        )
        return replace(
            self,
            R=R[0],
            p=p[0],
            v=p[3],
            rates=R[0] @ self.R.T @ self.rates,
            before_R=R[1],
            before_p=p[1],
            gravity=self.gravity + np.append(error[GRAVITY], 0.0),
            datum_R=R[2],
            datum_p=p[2],
            own=self.own + error[_SHARED : core()],
        )
