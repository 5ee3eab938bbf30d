"""True pose of a landing pad."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ros_visualise.data import Odometry, Transforms
from ros_visualise.simulation.frames import deck_frame
from ros_visualise.simulation.pad import PAD, PadParams
from ros_visualise.simulation.sensors import Fitting, Measure, SensorType
from ros_visualise.simulation.sensors.truth import ground_truth


def fit(fitting: Fitting) -> Measure:
    """Its pose and its frame."""
    pad = fitting.pad
    assert pad is not None, "switched on without a pad"

    def measure(stamp_ns: int, _: int) -> Mapping[str, Any]:
        pose, speed = (pad.position, pad.attitude), np.array(pad.velocity(stamp_ns / 1e9))
        return {
            "tf": Transforms((deck_frame(stamp_ns, *pose),)),
            "pad": ground_truth(stamp_ns, *pose, speed, np.zeros(3), PAD),
        }

    return measure


SENSOR = SensorType(
    PadParams, {"pad": Odometry}, "truth_rate", fit, "pad", always=True, standard=False
)
