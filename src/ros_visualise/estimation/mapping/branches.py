"""Resolving the pose ambiguity of small squares for whole tags and views.

The likelier reading of a single image is often the wrong one, and a local search never leaves it.
So each tag is tried in the alternative pose allowed by one of its images, over all of its views,
and likewise each view.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.mapping.minimising import GATE, robust
from ros_visualise.estimation.mapping.problem import Poses
from ros_visualise.estimation.mapping.terms import Terms
from ros_visualise.estimation.mapping.unknowns import Unknowns
from ros_visualise.geometry import rotations
from ros_visualise.geometry.se3 import rotation_vectors
from ros_visualise.landmarks.pose.refinement import moved

_APART_RAD = 0.1
_ROUNDS = 15
_GAIN = 1.0  # least decrease of the sum for which the other pose is chosen


class FlippedPoses(NamedTuple):
    """The better poses, how many changed, and the excess sums of the rejected ones (B,)."""

    state: Unknowns
    changed: int
    worse: Floats


def turn_tags(terms: Terms, state: Unknowns) -> FlippedPoses:
    """Tags in the pose with the smaller sum over all of their views, with fixed views."""
    other = _others(terms, state, tags=True)
    tried = _refit(terms, state._replace(tags=other), tags=True)
    return _better(terms, state, tried, tags=True)


def turn_views(terms: Terms, state: Unknowns) -> FlippedPoses:
    """Views in the pose with the smaller sum over all of their tags, with fixed tags."""
    other = _others(terms, state, tags=False)
    tried = _refit(terms, state._replace(views=other), tags=False)
    return _better(terms, state, tried, tags=False)


def _others(terms: Terms, state: Unknowns, tags: bool) -> Poses:
    """For each tag, or view, the alternative pose that differs most."""
    now = state.tags if tags else state.views
    numbers, R, t = [], [], []
    eyes, in_rig = terms.eyes(state), terms.layout.mounted(state.shared)
    for row, one in enumerate(terms.problem.sightings):
        for hypothesis in one.hypotheses:
            turned = rotations.to_matrix(hypothesis.quat_xyzw)
            if tags:
                numbers.append(one.tag)
                R.append(eyes.R[row] @ turned)
                t.append(eyes.R[row] @ hypothesis.position_xyz + eyes.t[row])
            else:
                numbers.append(one.view)
                eye = state.tags.R[one.tag] @ turned.T
                R.append(eye @ in_rig.R[one.camera].T)
                at = state.tags.t[one.tag] - eye @ hypothesis.position_xyz
                t.append(at - R[-1] @ in_rig.t[one.camera])
    number, there, place = np.array(numbers, int), np.array(R), np.array(t)
    apart = np.linalg.norm(rotation_vectors(np.swapaxes(now.R[number], 1, 2) @ there), axis=1)
    found = Poses(now.R.copy(), now.t.copy())
    for row in np.argsort(apart):
        found.R[number[row]], found.t[number[row]] = there[row], place[row]
    return found


def _refit(terms: Terms, state: Unknowns, tags: bool) -> Unknowns:
    """Gauss-Newton for each tag, or each view, alone: all others stay fixed."""
    of_view, of_tag = terms.corners.views, terms.corners.tags
    number = of_tag if tags else of_view
    for _ in range(_ROUNDS):
        bodies = state.tags if tags else state.views
        residuals, by_pose = _seen(terms, state)
        weights = robust(9 * GATE)((residuals**2).sum(axis=1))[0]
        by = terms.by_poses(state, by_pose)[int(tags)]
        by = by * np.sqrt(weights)[:, None, None]
        information = np.tile(1e-6 * np.eye(6), (len(bodies.t), 1, 1))
        slope = np.zeros((len(bodies.t), 6))
        np.add.at(information, number, np.swapaxes(by, 1, 2) @ by)
        weighted = (residuals * np.sqrt(weights)[:, None])[..., None]
        np.add.at(slope, number, (np.swapaxes(by, 1, 2) @ weighted)[..., 0])
        step = -np.linalg.solve(information, slope[..., None])[..., 0]
        size = np.linalg.norm(step[:, 3:], axis=1, keepdims=True)
        new = Poses(*moved(*bodies, step / np.maximum(1, size / 0.3)))
        state = state._replace(tags=new) if tags else state._replace(views=new)
    return state


def _seen(terms: Terms, state: Unknowns) -> tuple[Floats, Floats]:
    residuals, by_pose, _ = terms.seen(state, terms.sigma_px())
    bad = ~np.asarray(np.isfinite(residuals).all(axis=1))
    return np.where(bad[:, None], 1e3, residuals), np.where(bad[:, None, None], 0, by_pose)


def _better(terms: Terms, state: Unknowns, tried: Unknowns, tags: bool) -> FlippedPoses:
    """For each tag, or view, the pose with the smaller sum."""
    number = terms.corners.tags if tags else terms.corners.views
    now, then = (state.tags, tried.tags) if tags else (state.views, tried.views)
    sums = []
    for one in (state, tried):
        loss = robust(GATE)((_seen(terms, one)[0] ** 2).sum(axis=1))[1]
        sums.append(np.bincount(number, loss, minlength=len(now.t)))
    apart = np.linalg.norm(rotation_vectors(np.swapaxes(now.R, 1, 2) @ then.R), axis=1)
    is_other = apart > _APART_RAD
    take = is_other & (sums[1] < sums[0] - _GAIN)
    R, t = np.where(take[:, None, None], then.R, now.R), np.where(take[:, None], then.t, now.t)
    chosen = state._replace(tags=Poses(R, t)) if tags else state._replace(views=Poses(R, t))
    return FlippedPoses(
        chosen, int(take.sum()), np.where(is_other, np.abs(sums[1] - sums[0]), np.inf)
    )
