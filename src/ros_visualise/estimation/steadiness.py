"""Steadiness of a camera on the robot: whether its attitude errs by no more than is stated.

A gimbal that lags, or a mount that shakes, turns all that is in an image by one angle. If images
are likelier with an attitude that is unknown anew in each of them, for longer than by chance, the
next level holds from then on: three times the angle, changing ten times as fast. An image that
neither explains, such as one of a landmark that was moved, says nothing about the camera.

Source: E. Page, Continuous inspection schemes, Biometrika 41, 1954 (the cumulative sum).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ros_visualise.estimation.camera_view import CameraView
from ros_visualise.estimation.measuring import Pair, turn_of
from ros_visualise.estimation.settings import CameraErrors
from ros_visualise.estimation.state import State
from ros_visualise.estimation.updating import together

_UNSTEADY = math.log(1e6)
"""Log-likelihood ratio: a steady camera reaches it once in a million images."""

_MOST = 5.0  # that an image adds
_LEVELS = 2


@dataclass(frozen=True)
class Steadiness:
    """One camera, as images have shown it so far.

    Attributes:
        level: see `CameraErrors.at_level`.
        log_ratio: cumulative sum of log-likelihood ratios, of an unknown attitude to the level's.
    """

    level: int = 0
    log_ratio: float = 0.0

    def after(
        self, view: CameraView, pairs: Sequence[Pair], state: State, errors: CameraErrors
    ) -> Steadiness:
        """The same after an image of these landmarks."""
        if not pairs or not errors.turn_rad or self.level >= _LEVELS:
            return self
        next_rad = errors.at_level(self.level + 1).turn_rad
        as_stated, anew = together(view, pairs, state, turn_of(view.camera), next_rad**2)
        gain = min(anew.evidence - as_stated.evidence, _MOST) if anew.is_inlier else 0.0
        log_ratio = max(self.log_ratio + gain, 0.0)
        if log_ratio > _UNSTEADY:
            return Steadiness(self.level + 1)
        return Steadiness(self.level, log_ratio)
