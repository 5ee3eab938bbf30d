"""The robot propagated from a state by its own sensors, without the landmarks.

Between two images only the robot's own part of the state changes, so only that part is propagated.
The gained information is accumulated as it affects everything else, and is applied to the whole
state at once when the next image comes.

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
        robot: its estimate at that time.
        P: (CORE, CORE) covariance of its errors.
    """

    def __init__(self, state: FilterState) -> None:
        self.robot = state.robot
        self.P: Floats = state.covariance[:CORE, :CORE].copy()
        self._change = np.eye(CORE)  # from the state's errors to the robot's
        self._information = np.zeros((CORE, CORE))  # on the state's errors
        self._gradient = np.zeros(CORE)

    def copy(self) -> Propagation:
        """An independent copy."""
        new = copy(self)
        new.restore(self)
        return new

    def restore(self, other: Propagation) -> None:
        """Take over the values of another propagation."""
        self.robot, self.P, self._change = other.robot, other.P.copy(), other._change.copy()
        self._information, self._gradient = other._information.copy(), other._gradient.copy()

    def propagate(self, J: Floats, noise: Floats) -> None:
        """Propagate the errors by J (CORE, CORE) and add noise of that covariance."""
        self.P = J @ self.P @ J.T + noise
        self._change = J @ self._change

    def clone_pose(self) -> None:
        """Make the present pose the previous one (stochastic cloning)."""
        self.robot = self.robot.standing()
        self.P[BEFORE] = self.P[POSE]
        self.P[:, BEFORE] = self.P[:, POSE]
        self._change[BEFORE] = self._change[POSE]

    def correct(self, residual: Floats, H: Floats, noise: Floats, leeway: Floats | float) -> bool:
        """Apply a measurement of k numbers, unless it fails the 99.9% gate.

        Args:
            residual: (k,) measured minus expected.
            H: (k, CORE) derivative of the expected by the errors.
            noise: (k, k) covariance.
            leeway: (k,) standard deviation that the gate allows on top.

        Returns:
            True if it was applied.
        """
        PH = self.P @ H.T
        spread = H @ PH + noise
        gate = spread + np.diag(np.broadcast_to(np.square(leeway), len(residual)))
        if not residual @ np.linalg.solve(gate, residual) < GATES[len(residual)]:
            return False
        weight = np.linalg.inv(spread)
        gain = PH @ weight
        seen = H @ self._change
        self._gradient += seen.T @ (weight @ residual)
        self._information += seen.T @ weight @ seen
        self._change -= gain @ seen
        P = self.P - gain @ PH.T
        self.P = (P + P.T) / 2
        self.robot = self.robot.moved(gain @ residual)
        return True

    def applied_to(self, state: FilterState, frozen: bool) -> FilterState:
        """The whole state at this time; ``frozen`` landmarks are not corrected."""
        P = state.covariance.copy()
        across = P[:CORE, CORE:].copy()
        P[:CORE, :CORE] = self.P
        P[:CORE, CORE:] = self._change @ across
        P[CORE:, :CORE] = P[:CORE, CORE:].T
        if not frozen and self._gradient.any():
            P[CORE:, CORE:] -= across.T @ self._information @ across
            return state.with_robot(self.robot, P, across.T @ self._gradient)
        return state.with_robot(self.robot, P, None)
