"""True pose of a landing pad."""

from __future__ import annotations

import numpy as np

from ros_visualise.data import Odometry, Transforms
from ros_visualise.simulation.frames import deck_frame
from ros_visualise.simulation.pad import PAD, PadParams
from ros_visualise.simulation.schedule import Make, Measured
from ros_visualise.simulation.sensors import Fitting, SensorType
from ros_visualise.simulation.sensors.truth import tell_truth


def fit(fitting: Fitting) -> Make:
    """Its pose and its frame."""
    pad = fitting.pad
    assert pad is not None, "its switch is that of the pad"

    def measure(stamp_ns: int, _: int) -> Measured:
        yield "tf", Transforms((deck_frame(stamp_ns, pad.position, pad.attitude),))
        speed = np.array(pad.velocity(stamp_ns / 1e9))
        yield "pad", tell_truth(stamp_ns, pad.position, pad.attitude, speed, np.zeros(3), PAD)

    return measure


SENSOR = SensorType(
    PadParams, {"pad": Odometry}, "truth_rate", fit, "pad", always=True, standard=False
)
