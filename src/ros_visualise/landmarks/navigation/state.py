"""What the filter estimates: the robot, its odometry's errors, and landmarks, with one covariance.

The first states are those of the robot, `CORE` of them. Its pose needs no velocity where an
odometry tells how it moved; instead, the odometry's lasting errors are states: by how much all ways
and all turns are larger than it says. Without them ten metres of one error would look like a
thousand independent ones. Six states follow for each landmark; of one without an orientation, the
last three are zero and stay so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats
from ros_visualise.landmarks.navigation import twists

POSE, SCALES = slice(0, 6), slice(6, 8)
CORE = 8
PER_LANDMARK = 6

Indices = npt.NDArray[np.intp]


@dataclass
class State:
    """The estimate at one time.

    Attributes:
        R, p: the robot's pose in the map, (3, 3) and (3,).
        scales: (2,) by how much ways and turns are larger than the odometry says, as fractions.
        covariance: (n, n), n = CORE + 6 for each landmark, of twists as `twists` has them.
        keys: what the landmarks are called, in their order.
        landmarks_R, landmarks_p: their poses, (L, 3, 3) and (L, 3).
        first_p: (L, 3) where they were first believed to be.
    """

    R: Floats = field(default_factory=lambda: np.eye(3))
    p: Floats = field(default_factory=lambda: np.zeros(3))
    scales: Floats = field(default_factory=lambda: np.zeros(2))
    covariance: Floats = field(default_factory=lambda: np.zeros((CORE, CORE)))
    keys: list[str] = field(default_factory=list)
    landmarks_R: Floats = field(default_factory=lambda: np.zeros((0, 3, 3)))
    landmarks_p: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    first_p: Floats = field(default_factory=lambda: np.zeros((0, 3)))

    def copy(self) -> State:
        """Another one that may change by itself."""
        return replace(self, keys=list(self.keys), covariance=self.covariance.copy())

    def rows(self, key: str) -> slice:
        """Where a landmark's errors are in the covariance."""
        start = CORE + PER_LANDMARK * self.keys.index(key)
        return slice(start, start + PER_LANDMARK)

    def indices(self, keys: Sequence[str]) -> Indices:
        """(K,) places of landmarks among all landmarks."""
        place = {key: number for number, key in enumerate(self.keys)}
        return np.array([place[key] for key in keys], np.intp)

    def add(self, key: str, R: Floats, p: Floats, covariance: Floats, to_robot: bool) -> None:
        """Put a landmark in.

        Args:
            covariance: (6, 6) of its twist; where it is seen from the robot, that of the sight.
            to_robot: it is known by a sight from the robot, whose error it has too.
        """
        old = self.covariance
        size = len(old)
        new = np.zeros((size + PER_LANDMARK, size + PER_LANDMARK))
        new[:size, :size], new[size:, size:] = old, covariance
        if to_robot:
            new[size:, :size] = old[POSE]
            new[:size, size:] = old[:, POSE]
            new[size:, size:] += old[POSE, POSE]
        self.covariance = new
        self.keys.append(key)
        self.landmarks_R = np.concatenate([self.landmarks_R, R[None]])
        self.landmarks_p = np.concatenate([self.landmarks_p, p[None]])
        self.first_p = np.concatenate([self.first_p, p[None]])

    def remove(self, key: str) -> None:
        """Take a landmark out."""
        rows, number = self.rows(key), self.keys.index(key)
        kept = np.delete(np.arange(len(self.covariance)), rows)
        self.covariance = self.covariance[np.ix_(kept, kept)]
        self.keys.pop(number)
        self.landmarks_R = np.delete(self.landmarks_R, number, axis=0)
        self.landmarks_p = np.delete(self.landmarks_p, number, axis=0)
        self.first_p = np.delete(self.first_p, number, axis=0)

    def moved(self, error: Floats) -> State:
        """The same with other estimates, away by an error (n,); the covariance is as it was."""
        several = np.concatenate([error[None, POSE], error[CORE:].reshape(-1, PER_LANDMARK)])
        R = np.concatenate([self.R[None], self.landmarks_R])
        p = np.concatenate([self.p[None], self.landmarks_p])
        R, p = twists.moved(several, R, p)
        return replace(
            self,
            R=R[0],
            p=p[0],
            scales=self.scales + error[SCALES],
            landmarks_R=R[1:],
            landmarks_p=p[1:],
        )
