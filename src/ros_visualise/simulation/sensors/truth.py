"""Ground truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ros_visualise.data import Floats, Header, Odometry
from ros_visualise.data.header import read_only
from ros_visualise.simulation.attitude import Quat, Vector, xyzw
from ros_visualise.simulation.model import BASE
from ros_visualise.simulation.sensors import Fitting, Measure, SensorType, setting

_EXACT = read_only(np.zeros((6, 6)))


@dataclass(frozen=True)
class TruthParams:
    """Parameters of the ground truth."""

    truth_rate: float = setting(50.0, "ground-truth messages per second", min=0.1, max=200)


def ground_truth(
    stamp_ns: int,
    position: Vector,
    attitude: Quat,
    linear: Floats,
    angular: Floats,
    child: str = BASE,
) -> Odometry:
    """A body's exact pose in ``map`` and velocities in its own axes."""
    header = Header(stamp_ns, "map")
    pose = np.array(position), xyzw(attitude)
    return Odometry(*pose, linear, angular, _EXACT, _EXACT, child, header)


def fit(fitting: Fitting) -> Measure:
    """The pose of the robot's base."""
    body = fitting.robot.body
    return lambda stamp_ns, _: {
        "truth": ground_truth(stamp_ns, body.position, body.attitude, *body.velocity())
    }


SENSOR = SensorType(TruthParams, {"truth": Odometry}, "truth_rate", fit)
