"""Steadiness of a camera on the robot: whether its attitude errs by no more than is stated.

A gimbal that lags, or a mount that shakes, turns all that is in an image by one angle. If images
are likelier with an attitude that is unknown anew in each of them, for longer than by chance, the
next level holds from then on: with each, three times the angle, changing ten times as fast. An
image that neither explains, such as one of a landmark that was moved, says nothing about the
camera.

Source: E. Page, Continuous inspection schemes, Biometrika 41, 1954 (the cumulative sum).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from ros_visualise.estimation.gates import Innovation

_UNSTEADY = math.log(1e6)
"""Log-likelihood ratio: a steady camera reaches it once in a million images."""

_MOST = 5.0  # that an image adds
_LEVELS = 2.0
_STEADY_S = 20.0  # time constant of an attitude stated to be constant, where it is not


@dataclass(frozen=True)
class Steadiness:
    """One camera, as images have shown it so far.

    Attributes:
        level: see `loosened`.
        log_ratio: cumulative sum of log-likelihood ratios, of an unknown attitude to the level's.
        step: by which the level rises.
    """

    level: float = 0.0
    log_ratio: float = 0.0
    step: float = 1.0

    @property
    def next(self) -> float:
        """The level that images are held against."""
        return self.level + 1

    @property
    def is_final(self) -> bool:
        """True if the level rises no more."""
        return self.level >= _LEVELS

    def after(self, as_stated: Innovation, anew: Innovation) -> Steadiness:
        """The same after an image.

        Args:
            as_stated: innovation of the image, by the present level.
            anew: the same by an attitude that is unknown in this image, by the level `next`.
        """
        gain = min(anew.evidence - as_stated.evidence, _MOST) if anew.is_inlier else 0.0
        log_ratio = max(self.log_ratio + gain, 0.0)
        if log_ratio > _UNSTEADY:
            return replace(self, level=self.level + self.step, log_ratio=0.0)
        return replace(self, log_ratio=log_ratio)


def loosened(sigma_rad: float, time_s: float, level: float) -> tuple[float, float]:
    """Standard deviation and time constant of an attitude's error at a level; 0: as stated."""
    if not level:
        return sigma_rad, time_s
    return sigma_rad * 3**level, (time_s or _STEADY_S) / 10**level


def words(sigma_rad: float, time_s: float) -> str:
    """The same in words."""
    degrees = math.degrees(sigma_rad)
    return f"now assuming {degrees:.2g} degrees, with a time constant of {time_s:.2g} s"
