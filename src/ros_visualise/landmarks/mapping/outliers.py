"""Tags that are not what was thought: moved, there twice, or of another size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ros_visualise.data import Hypothesis
from ros_visualise.landmarks.mapping.normal import Numbers
from ros_visualise.landmarks.mapping.problem import Problem, TagSighting
from ros_visualise.landmarks.mapping.refitting import FARTHEST, refit
from ros_visualise.landmarks.mapping.sizes import larger
from ros_visualise.landmarks.mapping.smoothing import SmoothedMap
from ros_visualise.landmarks.mapping.terms import Terms
from ros_visualise.landmarks.mapping.unknowns import Unknowns

SIZE, MOVED, TWICE, UNSTEADY = "size", "moved", "twice", "unsteady"
ASTRAY = "astray"
"""The search threw the tag far off, which is no fault of the tag."""

_REFUSED, _LEAST = 0.2, 4  # of a tag's sightings, and how many: from here on it is looked at
_AGREE = 0.6  # of those sightings, that fit where the tag may be as well
_RESIZED = 0.03  # of its size, from which on that is not what was given
_OTHER, _SURE = 0.05, 6.0  # of a size where all sightings fit, and standard deviations
_REFINED = 0.003  # of one that was found to be another


@dataclass(frozen=True)
class Outlier:
    """A tag, what is wrong with it (`SIZE`, `MOVED`, `TWICE`, `UNSTEADY`, `ASTRAY`), and in words.

    ``value`` is its size by that which was given, how far it moved or is apart in metres, or of one
    that is unsteady which part of its sightings does not fit;
    ``sightings`` are those that are of the other place.
    """

    name: str
    kind: str
    text: str
    value: float = 0.0
    sightings: Sequence[int] = ()


def outliers(found: SmoothedMap) -> list[Outlier]:
    """Tags of whose sightings many do not fit, and what explains that."""
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
    """The tag that is most surely of another size, if any is: it makes others seem wrong.

    None that was surveyed: there it may be the survey.
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


def resized(given: Problem, found: SmoothedMap) -> list[Outlier]:
    """The tags that have come to be of another size than was given."""
    named = []
    for tag, (name, size, by) in enumerate(_sizes(given, found.problem)):
        if abs(np.log(by)) > _RESIZED / 2:
            fit = int(found.inliers[[one.tag == tag for one in found.problem.sightings]].sum())
            text = (
                f"its side is {size:.3f} m, not {size / by:.3f} m, by the {fit} sightings that fit:"
                " the map has it so; check what --tags or --size says of it"
            )
            named.append(Outlier(name, SIZE, text, by))
    return named


def _sizes(given: Problem, problem: Problem) -> list[tuple[str, float, float]]:
    """The name of each tag, its size in metres, and that by the one which was given."""
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
        share += ", so that it is not in the map"
    sized = refit(terms, state, rows, sized=True)
    explains = sized is not None and sized.fits[np.isin(rows, refused)].mean() > _AGREE
    if sized and explains and abs(np.log(sized.size)) > _RESIZED:
        return Outlier(name, SIZE, share, sized.size)
    other = refit(terms, state, refused, sized=False)
    if other is None or other.fits.mean() < _AGREE:
        return Outlier(name, UNSTEADY, f"{share}; no other place explains them", part)
    there, here = refused[other.fits], np.setdiff1d(rows, refused)
    stamps_s = terms.problem.stamps_ns[terms.corners.views] / 1e9
    apart = float(np.linalg.norm(other.t - state.tags.t[terms.corners.tags[rows[0]]]))
    if apart > FARTHEST * terms.problem.sightings[rows[0]].size_m:
        text = f"{share}: it was put where nobody sees it"
        return Outlier(name, ASTRAY, text, apart, refused[other.fits].tolist())
    if apart < terms.problem.sightings[rows[0]].size_m / 2:
        return Outlier(name, UNSTEADY, f"{share}; it has not moved", part)
    first, then = sorted((here, there), key=lambda one: stamps_s[one].min(initial=np.inf))
    if len(first) and len(then) and stamps_s[first].max() < stamps_s[then].min():
        text = f"it was moved by {apart:.2f} m before {stamps_s[then].min():.1f} s"
        return Outlier(
            name, MOVED, f"{text}: the map has it where it was last", apart, first.tolist()
        )
    text = f"there are two of it, {apart:.2f} m apart: the map has the one that is seen more often"
    return Outlier(name, TWICE, text, apart, there.tolist())


def corrected(problem: Problem, named: Sequence[Outlier]) -> Problem:
    """The problem with other sizes, and with a tag of its own for each other place."""
    names = [*problem.names]
    sightings = list(problem.sightings)
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
    return replace(problem, names=names, sightings=sightings)


def _scaled(sighting: TagSighting, by: float) -> Sequence[Hypothesis]:
    return [replace(h, position_xyz=h.position_xyz * by) for h in sighting.hypotheses]
