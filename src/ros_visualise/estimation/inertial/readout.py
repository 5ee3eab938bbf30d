"""Readout of a rolling shutter: an unknown constant that is estimated with the robot.

Such a camera reads a row of height y, from -1/2 at the top to 1/2, at ``y r`` after the stamp, with
``r`` the *readout*. A corner whose direction moves by ``u`` a second is then seen where it is at
the stamp, and ``y r u`` further. Optical flow shows ``u``; so a sighting is

    z = h(views, point) + r s + n,    s = y u,

with a *slip* s that is measured. The derivative by ``r`` is s, at every estimate, so linearization
adds no false information; and a motion of the whole map does not change it. A readout stretches and
shears the image in the direction of motion, and is observable as soon as that changes.

*The velocity* is the mean of those before and after the image, where there is a next one. Errors of
``u`` make ``r`` too small, as errors of any regressor do. So the estimate may wander, by 1 ms in a
second, and has a standard deviation of 2 ms in the end. Rotations in ``u`` that shift no rows are
those of `jumps`.

*The prior.* An image must be read before the next one: at 30 images a second, within 33 ms. Usual
sensors take 10 to 30 ms, and those with a global shutter 0. A normal distribution with a mean of
15 ms and a standard deviation of 10 ms has 0 and 30 ms at 1.5 standard deviations.

Source: M. Li, A. Mourikis, Vision-aided inertial navigation with rolling-shutter cameras, IJRR 2014
(sightings by rows; there the trajectory of the IMU moves each row, here the flow does).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats


class Readout(NamedTuple):
    """Time from the first to the last row of an image, and its standard deviation."""

    seconds: float
    sigma_s: float = 0.0

    @property
    def words(self) -> str:
        """Both in milliseconds, as text."""
        return f"{1e3 * self.seconds:.1f} ms, +-{1e3 * self.sigma_s:.1f}"


GLOBAL = Readout(0.0)
"""The readout of a global shutter."""
UNKNOWN = Readout(0.015, 0.01)
"""See the module."""
READOUT_WALK = 1e-3
"""s/sqrt(s), by which an unknown readout is let wander, see the module."""


def slips_of(rolling: Floats) -> Floats:
    """Slips (..., 2, 2) by readout and jumps: last axis.

    ``rolling`` (..., 5): velocities and rows as in `SeenCorners`; parts of these by `jumps`.
    """
    row = rolling[..., 2:3]
    return np.stack([rolling[..., :2] * row, -rolling[..., 3:] * row], axis=-1)
