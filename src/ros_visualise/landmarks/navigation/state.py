"""What the filter estimates: the robot and the landmarks, with one covariance.

The first states are the robot's own, `CORE` of them (`ros_visualise.landmarks.navigation.robot`).
Its odometry's lasting errors are among them: by how much all ways and all turns are larger than it
says. Without them ten metres of one error would look like a thousand independent ones. Six states
follow for each landmark; of one without an orientation, the last three are zero and stay so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats
from ros_visualise.landmarks.navigation import twists
from ros_visualise.landmarks.navigation.robot import CORE, POSE, RobotState

PER_LANDMARK = 6

Indices = npt.NDArray[np.intp]


@dataclass
class FilterState:
    """The estimate at one time.

    Attributes:
        robot: see there.
        covariance: (n, n), n = CORE + 6 for each landmark, of twists as `twists` has them.
        keys: what the landmarks are called, in their order.
        landmarks_R, landmarks_p: their poses, (L, 3, 3) and (L, 3).
        first_p: (L, 3) where they were first believed to be.
    """

    robot: RobotState = field(default_factory=RobotState)
    covariance: Floats = field(default_factory=lambda: np.zeros((CORE, CORE)))
    keys: list[str] = field(default_factory=list)
    landmarks_R: Floats = field(default_factory=lambda: np.zeros((0, 3, 3)))
    landmarks_p: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    first_p: Floats = field(default_factory=lambda: np.zeros((0, 3)))

    @property
    def R(self) -> Floats:  # noqa: N802 (as in `RobotState`)
        """(3, 3) the robot's attitude in the map."""
        return self.robot.R

    @property
    def p(self) -> Floats:
        """(3,) its position."""
        return self.robot.p

    def rows(self, key: str) -> slice:
        """Where a landmark's errors are in the covariance."""
        start = CORE + PER_LANDMARK * self.keys.index(key)
        return slice(start, start + PER_LANDMARK)

    def indices(self, keys: Sequence[str]) -> Indices:
        """(K,) places of landmarks among all landmarks."""
        place = {key: number for number, key in enumerate(self.keys)}
        return np.array([place[key] for key in keys], np.intp)

    def add(self, key: str, R: Floats, p: Floats, covariance: Floats) -> None:
        """Put a landmark in, with the covariance (6, 6) of its twist that nothing else shares."""
        old = self.covariance
        size = len(old)
        new = np.zeros((size + PER_LANDMARK, size + PER_LANDMARK))
        new[:size, :size], new[size:, size:] = old, covariance
        self.covariance = new
        self.keys = [*self.keys, key]
        self.landmarks_R = np.concatenate([self.landmarks_R, R[None]])
        self.landmarks_p = np.concatenate([self.landmarks_p, p[None]])
        self.first_p = np.concatenate([self.first_p, p[None]])

    def share(self, key: str, by: Floats | None = None) -> None:
        """What a landmark is seen from the robot for, it has the robot's error too.

        Args:
            by: (6, 6) how that moves it; by the same twist where None is given.
        """
        rows, P = self.rows(key), self.covariance
        by = np.eye(PER_LANDMARK) if by is None else by
        robot = by @ P[POSE, : rows.start]
        P[rows, : rows.start], P[: rows.start, rows] = robot, robot.T
        P[rows, rows] += robot[:, POSE] @ by.T

    def remove(self, key: str) -> None:
        """Take a landmark out."""
        rows, number = self.rows(key), self.keys.index(key)
        kept = np.delete(np.arange(len(self.covariance)), rows)
        self.covariance = self.covariance[np.ix_(kept, kept)]
        self.keys = self.keys[:number] + self.keys[number + 1 :]
        self.landmarks_R = np.delete(self.landmarks_R, number, axis=0)
        self.landmarks_p = np.delete(self.landmarks_p, number, axis=0)
        self.first_p = np.delete(self.first_p, number, axis=0)

    def moved(self, error: Floats) -> FilterState:
        """The same with other estimates, away by an error (n,); the covariance is as it was."""
        robot = self.robot.moved(error[:CORE])
        return self.with_robot(robot, self.covariance, error[CORE:])

    def with_robot(
        self, robot: RobotState, covariance: Floats, error: Floats | None
    ) -> FilterState:
        """The same with another robot and covariance, and landmarks away by an error."""
        new = replace(self, robot=robot, covariance=covariance)
        if error is not None and len(self.keys):
            several = error.reshape(-1, PER_LANDMARK)
            moved = twists.moved(several, self.landmarks_R, self.landmarks_p)
            new.landmarks_R, new.landmarks_p = moved
        return new
