"""The node that holds an estimated pose against the truth of a simulation."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ros_visualise.core.synchronizer import Exact
from ros_visualise.data import Number, Odometry, PoseWithCovarianceStamped
from ros_visualise.geometry.trajectory_errors import NEES_BAND, nees, pose_error
from ros_visualise.landmarks.once_log import OnceLog
from ros_visualise.nodes import NoParams, node


@node(
    "pose_error",
    params=NoParams,
    inputs={"pose": PoseWithCovarianceStamped, "truth": Odometry},
    outputs={"nees": Number, "error": Number},
    topics={"error": "/position_error"},
    sync=Exact(),
    splittable=False,
)
class PoseError:
    """Error of a pose: in metres, and relative to its own covariance (NEES).

    NEES is 6 on average where the covariance is honest, and from 1.2 to 14.4 in 95 of 100 cases.
    """

    def __init__(self, params: NoParams) -> None:
        self._remarks = OnceLog("pose_error")
        self.reset()

    def reset(self) -> None:
        self._count, self._squared_m = 0, 0.0
        self._with_covariance, self._inside, self._sum = 0, 0, 0.0

    def step(
        self, pose: PoseWithCovarianceStamped, truth: Odometry, params: NoParams
    ) -> dict[str, Any] | None:
        frames = pose.header.frame_id, truth.header.frame_id
        if frames[0] != frames[1]:
            self._remarks.say(
                f"no error: the pose is in frame {frames[0]}, but the truth is in {frames[1]}"
            )
            return None
        error = pose_error(pose.position_xyz, pose.quat_xyzw, truth.position_xyz, truth.quat_xyzw)
        away_m = float(np.linalg.norm(error[:3]))
        self._count += 1
        self._squared_m += away_m**2
        found: dict[str, Any] = {"error": Number(away_m, pose.header)}
        normalised = nees(error, pose.covariance)
        if normalised is not None:
            self._with_covariance += 1
            self._sum += normalised
            self._inside += NEES_BAND[0] < normalised < NEES_BAND[1]
            found["nees"] = Number(normalised, pose.header)
        return found

    def report(self) -> dict[str, Any]:
        """The whole run: root mean square in metres, mean NEES, and how many lie in the band."""
        count = self._with_covariance
        return {
            "rmse_m": math.sqrt(self._squared_m / self._count) if self._count else None,
            "mean_nees": self._sum / count if count else None,
            "inside_95": self._inside / count if count else None,
        }
