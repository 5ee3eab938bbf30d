"""The filter's state: the robot and the landmarks, with one covariance.

The first `CORE` states are the robot's own (`ros_visualise.landmarks.navigation.robot`). They
include the constant scale errors of its odometry: without these, ten metres with one error would
look like a thousand independent ones. Six states follow for each landmark; without an orientation,
the last three are zero and stay so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats
from ros_visualise.geometry import se3
from ros_visualise.landmarks.navigation.robot import CORE, POSE, RobotState

PER_LANDMARK = 6

Indices = npt.NDArray[np.intp]


@dataclass
class FilterState:
    """The estimate at one time.

    Attributes:
        robot: see `RobotState`.
        covariance: (n, n), n = CORE + 6 for each landmark, of errors (`geometry.se3`).
        keys: names of the landmarks' readings, in order.
        landmarks_R, landmarks_p: their poses, (L, 3, 3) and (L, 3).
        first_p: (L, 3) their first estimated positions.
    """

    robot: RobotState = field(default_factory=RobotState)
    covariance: Floats = field(default_factory=lambda: np.zeros((CORE, CORE)))
    keys: list[str] = field(default_factory=list)
    landmarks_R: Floats = field(default_factory=lambda: np.zeros((0, 3, 3)))
    landmarks_p: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    first_p: Floats = field(default_factory=lambda: np.zeros((0, 3)))

    @property
    def R(self) -> Floats:  # noqa: N802 (as in `RobotState`)
        """(3, 3) attitude of the robot in the map."""
        return self.robot.R

    @property
    def p(self) -> Floats:
        """(3,) position of the robot in the map."""
        return self.robot.p

    def rows(self, key: str) -> slice:
        """The rows of a landmark's errors in the covariance."""
        start = CORE + PER_LANDMARK * self.keys.index(key)
        return slice(start, start + PER_LANDMARK)

    def indices(self, keys: Sequence[str]) -> Indices:
        """(K,) indices of landmarks among all landmarks."""
        place = {key: number for number, key in enumerate(self.keys)}
        return np.array([place[key] for key in keys], np.intp)

    def add(self, key: str, R: Floats, p: Floats, covariance: Floats) -> None:
        """Add a landmark with an independent covariance (6, 6) of its twist."""
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
        """Add the robot's error to a landmark that was seen from the robot.

        Args:
            by: (6, 6) effect of that error on the landmark; None: the same twist.
        """
        rows, P = self.rows(key), self.covariance
        by = np.eye(PER_LANDMARK) if by is None else by
        robot = by @ P[POSE, : rows.start]
        P[rows, : rows.start], P[: rows.start, rows] = robot, robot.T
        P[rows, rows] += robot[:, POSE] @ by.T

    def remove(self, key: str) -> None:
        """Remove a landmark."""
        rows, number = self.rows(key), self.keys.index(key)
        kept = np.delete(np.arange(len(self.covariance)), rows)
        self.covariance = self.covariance[np.ix_(kept, kept)]
        self.keys = self.keys[:number] + self.keys[number + 1 :]
        self.landmarks_R = np.delete(self.landmarks_R, number, axis=0)
        self.landmarks_p = np.delete(self.landmarks_p, number, axis=0)
        self.first_p = np.delete(self.first_p, number, axis=0)

    def moved(self, error: Floats) -> FilterState:
        """The same, corrected by an error (n,), with unchanged covariance."""
        robot = self.robot.moved(error[:CORE])
        return self.with_robot(robot, self.covariance, error[CORE:])

    def with_robot(
        self, robot: RobotState, covariance: Floats, error: Floats | None
    ) -> FilterState:
        """The same with another robot and covariance, and landmarks corrected by an error."""
        new = replace(self, robot=robot, covariance=covariance)
        if error is not None and len(self.keys):
            several = error.reshape(-1, PER_LANDMARK)
            moved = se3.moved(several, self.landmarks_R, self.landmarks_p)
            new.landmarks_R, new.landmarks_p = moved
        return new
