"""Wind with gusts, and its forces on a quadrotor.

Source: MIL-F-8785C, Flying qualities of piloted airplanes, 1980, section 3.7: Dryden's spectra at
low altitudes, and the mean wind near the ground.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.simulation.attitude import Vector
from ros_visualise.simulation.model import BASE
from ros_visualise.simulation.noise import random_of
from ros_visualise.simulation.sensors import setting

_wind = partial(setting, group="wind")

_FOOT_M = 0.3048
_REFERENCE_M = 20 * _FOOT_M  # height of the given wind speed
_ROUGHNESS_M = 0.15 * _FOOT_M  # of the ground, for take-off and landing
_LOWEST_M, _HIGHEST_M = 10 * _FOOT_M, 1000 * _FOOT_M  # where the spectra hold
_SLOWEST_M_S = 0.5  # speed relative to the gusts
_STEPS = 4  # of the physics: every 20 ms


@dataclass(frozen=True)
class WindParams:
    """Parameters of the wind."""

    wind: float = _wind(0.0, "mean wind speed 6 m above the ground, m/s", min=0, max=20)
    wind_direction: float = _wind(
        0.0, "direction that the wind blows to: 0 east, 90 north, degrees", min=-360, max=360
    )
    gusts: float = _wind(1.0, "strength of the gusts; 1: normal for this wind speed", min=0, max=5)


def mean_wind(speed: float, height_m: float) -> float:
    """The mean wind at a height, m/s, given its ``speed`` at 6 m above the ground."""
    height_m = max(height_m, 2 * _ROUGHNESS_M)
    return speed * math.log(height_m / _ROUGHNESS_M) / math.log(_REFERENCE_M / _ROUGHNESS_M)


def dryden(speed: float, height_m: float) -> tuple[Floats, Floats]:
    """Deviations (3,) in m/s and lengths (3,) in metres of gusts: along the wind, across, up."""
    feet = min(max(height_m, _LOWEST_M), _HIGHEST_M) / _FOOT_M
    ratio = 0.177 + 0.000823 * feet
    up, level = 0.1 * speed, 0.1 * speed / ratio**0.4
    long_m = feet / ratio**1.2 * _FOOT_M
    return np.array([level, level, up]), np.array([long_m, long_m, feet * _FOOT_M])


class Gusts:
    """Noise with Dryden's spectra, starting in its steady state.

    Along the wind it is noise through one lag of L / V, the length of gusts over the relative
    speed. Across and up there are two lags, the first with more weight: (1 + sqrt(3) T s) / (1 + T
    s)^2.

    Args:
        random: source of random numbers.
    """

    def __init__(self, random: np.random.Generator) -> None:
        self._random = random
        self._lags = [_advance((0.0, 0.0), math.inf, kick) for kick in self._kicks()]

    def step(self, elapsed_s: float, deviations: Floats, lengths_m: Floats, speed: float) -> Floats:
        """The gusts (3,) after some time: along the wind, across, up; m/s."""
        parts = (elapsed_s * max(speed, _SLOWEST_M_S) / lengths_m).tolist()
        self._lags = [
            _advance(lags, part, kick)
            for lags, part, kick in zip(self._lags, parts, self._kicks(), strict=True)
        ]
        first, second = np.array(self._lags).T
        shaped = math.sqrt(3) * first + (1 - math.sqrt(3)) * second
        gusts: Floats = deviations * [math.sqrt(2) * first[0], shaped[1], shaped[2]]
        return gusts

    def _kicks(self) -> list[list[float]]:
        kicks: list[list[float]] = self._random.standard_normal((3, 2)).tolist()
        return kicks


def _advance(lags: Sequence[float], part: float, kick: Sequence[float]) -> tuple[float, float]:
    """Two lags in series, driven by white noise whose intensity is their time constant.

    Exact for any fraction ``part`` of that constant: the added noise gives variances of 1/2 and 1/4
    and a covariance of 1/4 in the steady state.
    """
    keep = math.exp(-part)
    carried = keep * part if keep else 0.0
    q11 = (1 - keep**2) / 2
    q12 = (1 - keep**2) / 4 - keep * carried / 2
    q22 = (1 - keep**2) / 4 - keep * carried / 2 - carried**2 / 2
    l11 = math.sqrt(q11)
    l21 = q12 / l11 if l11 else 0.0
    l22 = math.sqrt(max(q22 - l21**2, 0.0))
    first = keep * lags[0] + l11 * kick[0]
    second = carried * lags[0] + keep * lags[1] + l21 * kick[0] + l22 * kick[1]
    return first, second


class Wind:
    """Wind on a quadrotor: MuJoCo computes the drag of its body, this class that of its rotors.

    The rotors' drag is proportional to the speed of the air across them.

    Args:
        model: the ``mjModel`` of the quadrotor.
        data: its ``mjData``.
        params: the wind.
        seed: of the gusts.

    Attributes:
        velocity: of the air at the quadrotor, m/s in ``map``.

    Source: Faessler, Franchi and Scaramuzza, Differential flatness of quadrotor dynamics subject to
    rotor drag, 2018, section III.
    """

    def __init__(self, model: Any, data: Any, params: WindParams, seed: int) -> None:
        self._model, self._data, self._params = model, data, params
        self._base = model.body(BASE).id
        self._weight = float(model.body(BASE).subtreemass[0]) * -float(model.opt.gravity[2])
        self._drag = float(model.numeric("rotor_drag").data[0])
        self._elapsed_s = _STEPS * float(model.opt.timestep)
        self._gusts = Gusts(random_of(seed, "wind"))
        self._steps = 0
        self.velocity: Vector = (0.0, 0.0, 0.0)

    def advance(self) -> None:
        """Set the air's motion and its forces for the next step."""
        data = self._data
        if self._params.wind and self._steps % _STEPS == 0:
            self.velocity = self._blow(float(data.qpos[2]))
            self._model.opt.wind[:] = self.velocity
        self._steps += 1
        lift = float(data.actuator_force.sum())
        if lift <= 0:
            data.xfrc_applied[self._base, :3] = 0.0
            return
        ux, uy, uz = data.xmat[self._base].tolist()[2::3]
        x, y, z = (w - v for w, v in zip(self.velocity, data.qvel[:3].tolist(), strict=True))
        along = x * ux + y * uy + z * uz
        drag = self._drag * math.sqrt(lift / self._weight)  # as the rotors turn
        force = drag * (x - along * ux), drag * (y - along * uy), drag * (z - along * uz)
        data.xfrc_applied[self._base, :3] = force

    def _blow(self, height_m: float) -> Vector:
        p = self._params
        mean = mean_wind(p.wind, height_m)
        deviations, lengths = dryden(p.wind, height_m)
        gusts = self._gusts.step(self._elapsed_s, p.gusts * deviations, lengths, mean)
        ahead, left, up = (gusts + np.array([mean, 0.0, 0.0])).tolist()
        turn = math.radians(p.wind_direction)
        c, s = math.cos(turn), math.sin(turn)
        return c * ahead - s * left, s * ahead + c * left, up
