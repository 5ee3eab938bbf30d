"""Tags whose given size is wrong, from all views.

A tag that is alone in its images and has a wrong size fits them equally well at another place, but
makes the distances between the views too long or too short. What odometry and other tags say about
these is in the normal equations already; one more unknown per tag gives its size.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.mapping.minimising import final
from ros_visualise.estimation.mapping.smoothing import SmoothedMap
from ros_visualise.estimation.mapping.terms import Terms
from ros_visualise.estimation.mapping.unknowns import PRINTED, Unknowns

_AT_ONCE = 32  # tags


class SizeErrors(NamedTuple):
    """Relative error (M,) of the given size of each tag, and its standard deviation."""

    part: Floats
    sigma: Floats


def larger(found: SmoothedMap) -> SizeErrors:
    """The size error of each tag, to first order, if it were the only unknown size.

    Raises:
        numpy.linalg.LinAlgError: the problem is underdetermined.

    Source: C. R. Rao, Large sample tests of statistical hypotheses concerning several parameters,
    1948 (the score test, which needs no second search).
    """
    terms = Terms(found.problem, found.noise)
    state = Unknowns(found.views, found.tags, found.shared)
    sigma_px = terms.sigma_px() * np.sqrt(found.noise.views)
    residuals, by_pose, by_shared = terms.seen(state, sigma_px)
    several = (residuals, *terms.by_poses(state, by_pose), by_shared)
    residuals, by_view, by_tag, by_shared = (one[found.inliers] for one in several)
    views, tags = terms.corners.views[found.inliers], terms.corners.tags[found.inliers]
    by_size = by_shared[..., PRINTED]
    factor, count = final(terms, state, found.inliers), len(found.problem.names)
    structure = terms.structure
    parts = structure.parts(((views, by_view), (tags + structure.views, by_tag)), by_shared)
    explained = np.zeros(count)
    for begin in range(0, count, _AT_ONCE):
        rows = (tags >= begin) & (tags < begin + _AT_ONCE)
        right = np.zeros((structure.size, 6, _AT_ONCE))
        for block, by in parts:
            slopes = np.einsum("ski,sk->si", by[rows], by_size[rows])
            np.add.at(np.swapaxes(right, 1, 2), (block[rows], tags[rows] - begin), slopes)
        some = (right * factor.solve(right)).sum(axis=(0, 1))
        explained[begin : begin + _AT_ONCE] = some[: count - begin]
    whole = np.bincount(tags, (by_size**2).sum(axis=1), minlength=count)
    slope = np.bincount(tags, (by_size * residuals).sum(axis=1), minlength=count)
    left = np.maximum(whole - explained, 1e-9 * whole + 1e-12)
    return SizeErrors(-slope / left, 1 / np.sqrt(left))
