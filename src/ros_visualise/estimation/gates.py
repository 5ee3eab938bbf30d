"""Tests of measurements against what a filter expects of them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats

GATES = {1: 10.83, 2: 13.82, 3: 16.27, 4: 18.47, 5: 20.52, 6: 22.46, 8: 26.12}
"""Number of measured values -> 99.9% point of the chi-square distribution, for squared Mahalanobis
distances.
"""

DECIDED = 6.0
"""Log-likelihood ratio that decides between two hypotheses."""

WORST = -40.0
"""Log-likelihood of a measurement that does not fit at all: one more says nothing more."""

_ALTERNATIVE = math.log(3.0)  # log of how many times larger the errors of a misfit are
_MISFIT = math.log(1e3)


def gate(size: int) -> float:
    """99.9% point of the chi-square distribution of any number of measured values.

    Source: E. Wilson, M. Hilferty, The distribution of chi-square, 1931; within 0.1% from 9 on.
    """
    part = 2 / (9 * size)
    return GATES.get(size) or size * (1 - part + 3.0902 * math.sqrt(part)) ** 3


class Innovation(NamedTuple):
    """Consistency of a measurement with the state: a squared Mahalanobis distance.

    ``size`` is the count of measured numbers, ``evidence`` the log-likelihood relative to that of
    the noise alone.
    """

    distance2: float
    size: int
    evidence: float

    @property
    def is_inlier(self) -> bool:
        """True if it passes the 99.9% gate."""
        return self.distance2 < gate(self.size)

    @classmethod
    def of(cls, residual: Floats, spread: Floats, noise: Floats, beyond: float = 0.0) -> Innovation:
        """The innovation of a residual (k,) of covariance ``spread``, with ``noise`` in it.

        Args:
            beyond: added to the squared distance.
        """
        distance2 = float(residual @ np.linalg.solve(spread, residual)) + beyond
        volume = float(np.linalg.slogdet(noise)[1] - np.linalg.slogdet(spread)[1])
        return cls(distance2, len(residual), (volume - distance2) / 2)


@dataclass(frozen=True)
class MisfitTest:
    """Decides if errors are as stated or three times as large, by all measurements so far.

    If errors are as stated, the likelihood ratio ever exceeds 1000 with a probability of at most
    one in 1000, however often one looks.

    Source: A. Wald, Sequential Analysis, 1947; J. Ville, Etude critique de la notion de collectif,
    1939 (the bound for all times).
    """

    log_ratio: float = 0.0

    def after(self, fit: Innovation) -> MisfitTest:
        """The test after another measurement."""
        gain = fit.distance2 / 2 * (1 - math.exp(-2 * _ALTERNATIVE)) - fit.size * _ALTERNATIVE
        return MisfitTest(self.log_ratio + gain)

    @property
    def is_misfit(self) -> bool:
        """True if errors are larger than stated."""
        return self.log_ratio > _MISFIT
