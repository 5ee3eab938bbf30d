"""The robot some time after a state, without the landmarks: what it measures itself comes in here.

Between two images only the robot's own part changes. So that part alone is carried on, and what
came to be known on the way is kept as it concerns everything else: it is put into the whole state
at once, when the next image comes.

Source: A. Bryson, M. Frazier, Smoothing for linear and nonlinear dynamic systems, 1963 (the sums
that take later measurements back to an earlier time).
"""

from __future__ import annotations

from copy import copy

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.landmarks.localization.estimate import GATES
from ros_visualise.landmarks.navigation.robot import BEFORE, CORE, POSE
from ros_visualise.landmarks.navigation.state import FilterState


class Propagation:
    """The robot some time after a state.

    Attributes:
        robot: as it is then.
        P: (CORE, CORE) covariance of its errors.
    """

    def __init__(self, state: FilterState) -> None:
        self.robot = state.robot
        self.P: Floats = state.covariance[:CORE, :CORE].copy()
        self._change = np.eye(CORE)  # how its errors follow from those of the state
        self._told = np.zeros((CORE, CORE))  # information on the state's errors, gained since
        self._push = np.zeros(CORE)

    def copy(self) -> Propagation:
        """Another one that goes on by itself."""
        new = copy(self)
        new.become(self)
        return new

    def become(self, other: Propagation) -> None:
        """Be what another one is."""
        self.robot, self.P, self._change = other.robot, other.P.copy(), other._change.copy()
        self._told, self._push = other._told.copy(), other._push.copy()

    def go(self, J: Floats, noise: Floats) -> None:
        """Errors change by J (CORE, CORE), and noise of that covariance comes to them."""
        self.P = J @ self.P @ J.T + noise
        self._change = J @ self._change

    def remember(self) -> None:
        """From now on, the pose of before is this one."""
        self.robot = self.robot.standing()
        self.P[BEFORE] = self.P[POSE]
        self.P[:, BEFORE] = self.P[:, POSE]
        self._change[BEFORE] = self._change[POSE]

    def correct(self, residual: Floats, H: Floats, noise: Floats, leeway: Floats | float) -> bool:
        """Take a measurement of k numbers, unless it is one of 1000 that are farthest off.

        Args:
            residual: (k,) what was measured, less what was expected.
            H: (k, CORE) how what is expected depends on the errors.
            noise: (k, k) covariance.
            leeway: (k,) standard deviation that is forgiven beside that.

        Returns:
            Whether it was taken.
        """
        PH = self.P @ H.T
        spread = H @ PH + noise
        gate = spread + np.diag(np.broadcast_to(np.square(leeway), len(residual)))
        if not residual @ np.linalg.solve(gate, residual) < GATES[len(residual)]:
            return False
        weight = np.linalg.inv(spread)
        gain = PH @ weight
        seen = H @ self._change
        self._push += seen.T @ (weight @ residual)
        self._told += seen.T @ weight @ seen
        self._change -= gain @ seen
        P = self.P - gain @ PH.T
        self.P = (P + P.T) / 2
        self.robot = self.robot.moved(gain @ residual)
        return True

    def into(self, state: FilterState, frozen: bool) -> FilterState:
        """The whole state as it is by now; ``frozen`` landmarks learn nothing of it."""
        P = state.covariance.copy()
        across = P[:CORE, CORE:].copy()
        P[:CORE, :CORE] = self.P
        P[:CORE, CORE:] = self._change @ across
        P[CORE:, :CORE] = P[:CORE, CORE:].T
        if not frozen and self._push.any():
            P[CORE:, CORE:] -= across.T @ self._told @ across
            return state.with_robot(self.robot, P, across.T @ self._push)
        return state.with_robot(self.robot, P, None)
