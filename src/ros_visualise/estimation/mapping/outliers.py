"""Outlier tags: moved, duplicated, or of another size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ros_visualise.data import Hypothesis
from ros_visualise.estimation.mapping.normal import Numbers
from ros_visualise.estimation.mapping.problem import Problem, TagSighting
from ros_visualise.estimation.mapping.refitting import FARTHEST, refit
from ros_visualise.estimation.mapping.sizes import larger
from ros_visualise.estimation.mapping.smoothing import SmoothedMap
from ros_visualise.estimation.mapping.terms import Terms
from ros_visualise.estimation.mapping.unknowns import Unknowns

SIZE, MOVED, TWICE, UNSTEADY = "size", "moved", "twice", "unsteady"
SURVEY, HANGING = "survey", "hanging"
ASTRAY = "astray"
"""The search itself moved the tag far away."""

_REFUSED, _LEAST = 0.2, 4  # fraction and number of rejected sightings of an outlier
_AGREE = 0.6  # fraction of those sightings that support the explanation
_RESIZED = 0.03  # smallest relative error of a size
_OTHER, _SURE = 0.05, 6.0  # the same with all sightings inliers, and in sigmas
_STANDS_OUT = 4.0  # times the median residual of a survey
_REFINED = 0.003  # smallest relative change of a corrected size


@dataclass(frozen=True)
class Outlier:
    """A tag, its fault and a sentence.

    ``kind`` is `SIZE`, `MOVED`, `TWICE`, `UNSTEADY`, `ASTRAY`, `SURVEY` (its survey is wrong), or
    `HANGING` (only what is wrong connects it with the map).

    ``value`` is the ratio of its size to the given one, its displacement in metres, or, for an
    unsteady one, the fraction of sightings that do not fit. ``sightings`` are those of the other
    place.
    """

    name: str
    kind: str
    text: str
    value: float = 0.0
    sightings: Sequence[int] = ()


def outliers(found: SmoothedMap) -> list[Outlier]:
    """Tags with many sightings that do not fit, and the explanation."""
    terms = Terms(found.problem, found.noise)
    state = Unknowns(found.views, found.tags, found.shared)
    named = []
    for tag, name in enumerate(found.problem.names):
        rows = np.flatnonzero(terms.corners.tags == tag)
        refused = rows[~found.inliers[rows]]
        if len(refused) >= max(_LEAST, _REFUSED * len(rows)) and " " not in name:
            named.append(_explained(terms, state, name, rows, refused))
    return named


def other_size(given: Problem, found: SmoothedMap) -> list[Outlier]:
    """The tag whose size is most certainly wrong, if any: it makes others look wrong.

    Surveyed tags are excluded: there the survey may be wrong.
    """
    part, sigma = larger(found)
    changed = np.array([by for _, _, by in _sizes(given, found.problem)])
    least = np.where(np.abs(np.log(changed)) > _RESIZED / 2, _REFINED, _OTHER)
    sure = np.where(np.abs(part) > least, np.abs(part) / sigma, 0)
    sure[[one.tag for one in found.problem.surveyed]] = 0
    tag = int(sure.argmax())
    if sure[tag] < _SURE:
        return []
    return [Outlier(found.problem.names[tag], SIZE, "", max(1 + float(part[tag]), 0.2))]


def wrong_survey(found: SmoothedMap) -> list[Outlier]:
    """The surveyed tag that most certainly disagrees with the views and the others, if any.

    Source: W. Baarda, A testing procedure for use in geodetic networks, 1968 (data snooping: the
    largest residual by its own standard deviation, one at a time). It must also stand out from the
    others, which may all be worse than given.
    """
    surveyed = found.problem.surveyed
    off = np.array([found.tags.t[one.tag] - one.position_xyz for one in surveyed]).reshape(-1, 3)
    given = np.array([one.position_sigma for one in surveyed]).reshape(-1, 3) ** 2
    after = np.diagonal(found.covariances[[one.tag for one in surveyed], :3, :3], 0, 1, 2)
    left = given - after  # variances of the residuals; 0 where nothing else tells the position
    ratio = np.where(left > 0.1 * given, np.abs(off) / np.sqrt(np.maximum(left, 1e-18)), 0.0)
    worst = ratio.max(axis=1)
    if not len(worst) or worst.max() < max(_STANDS_OUT * float(np.median(worst)), _SURE):
        return []
    number = int(worst.argmax())
    text = (
        f"its surveyed position is {np.linalg.norm(off[number]):.2f} m"
        f" ({worst[number]:.0f} sigma) from where the views place it; ignored"
    )
    return [Outlier(found.problem.names[surveyed[number].tag], SURVEY, text)]


def resized(given: Problem, found: SmoothedMap) -> list[Outlier]:
    """The tags whose size was corrected."""
    named = []
    for tag, (name, size, by) in enumerate(_sizes(given, found.problem)):
        if abs(np.log(by)) > _RESIZED / 2:
            fit = int(found.inliers[[one.tag == tag for one in found.problem.sightings]].sum())
            text = (
                f"its side is {size:.3f} m, not {size / by:.3f} m, according to {fit} inlier"
                f" sightings;"
                " corrected in the map; check --tags or --size"
            )
            named.append(Outlier(name, SIZE, text, by))
    return named


def _sizes(given: Problem, problem: Problem) -> list[tuple[str, float, float]]:
    """The name of each tag, its size in metres, and its ratio to the given size."""
    before = {given.names[one.tag]: one.size_m for one in given.sightings}
    sizes = {one.tag: one.size_m for one in problem.sightings}
    return [
        (name, size, size / before.get(name, size))
        for tag, name in enumerate(problem.names)
        for size in [sizes.get(tag, 1.0)]
    ]


def _explained(
    terms: Terms, state: Unknowns, name: str, rows: Numbers, refused: Numbers
) -> Outlier:
    part = len(refused) / len(rows)
    share = f"{len(refused)} of its {len(rows)} sightings do not fit"
    if part > 0.5:
        share += "; omitted from the map"
    sized = refit(terms, state, rows, sized=True)
    explains = sized is not None and sized.fits[np.isin(rows, refused)].mean() > _AGREE
    plain = refit(terms, state, rows, sized=False) if explains else None
    if sized and plain:  # else another size is no better than another pose
        explains = sized.fits.sum() - plain.fits.sum() >= max(_LEAST, _REFUSED * len(rows))
    if sized and explains and abs(np.log(sized.size)) > _RESIZED:
        return Outlier(name, SIZE, share, sized.size)
    other = refit(terms, state, refused, sized=False)
    if other is None or other.fits.mean() < _AGREE:
        return Outlier(name, UNSTEADY, f"{share}; no other pose explains them", part)
    there, here = refused[other.fits], np.setdiff1d(rows, refused)
    stamps_s = terms.problem.stamps_ns[terms.corners.views] / 1e9
    apart = float(np.linalg.norm(other.t - state.tags.t[terms.corners.tags[rows[0]]]))
    if apart > FARTHEST * terms.problem.sightings[rows[0]].size_m:
        text = f"{share}: the mapping placed it where it could not have been seen"
        return Outlier(name, ASTRAY, text, apart, refused[other.fits].tolist())
    if apart < terms.problem.sightings[rows[0]].size_m / 2:
        return Outlier(name, UNSTEADY, f"{share}; it has not moved", part)
    first, then = sorted((here, there), key=lambda one: stamps_s[one].min(initial=np.inf))
    if len(first) and len(then) and stamps_s[first].max() < stamps_s[then].min():
        text = f"it moved by {apart:.2f} m before {stamps_s[then].min():.1f} s"
        return Outlier(
            name, MOVED, f"{text}; the map contains its last pose", apart, first.tolist()
        )
    text = f"two copies, {apart:.2f} m apart; kept the one seen more often"
    return Outlier(name, TWICE, text, apart, there.tolist())


def corrected(problem: Problem, named: Sequence[Outlier]) -> Problem:
    """The problem with other sizes, and with an additional tag for each other place."""
    names = [*problem.names]
    sightings = list(problem.sightings)
    wrong = {problem.names.index(one.name) for one in named if one.kind == SURVEY}
    surveyed = [one for one in problem.surveyed if one.tag not in wrong]
    for one in named:
        tag = problem.names.index(one.name)
        if one.kind == SIZE:
            sightings = [
                replace(s, size_m=s.size_m * one.value, hypotheses=_scaled(s, one.value))
                if s.tag == tag
                else s
                for s in sightings
            ]
        elif one.sightings:
            names.append(f"{one.name} elsewhere")
            for row in one.sightings:
                sightings[row] = replace(sightings[row], tag=len(names) - 1)
    return replace(problem, names=names, sightings=sightings, surveyed=surveyed)


def _scaled(sighting: TagSighting, by: float) -> Sequence[Hypothesis]:
    return [replace(h, position_xyz=h.position_xyz * by) for h in sighting.hypotheses]
