"""Reports of map smoothing, in words and as values."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.core.printing import counted, escaped
from ros_visualise.estimation.mapping.mapping import TagMap
from ros_visualise.estimation.mapping.outliers import UNSTEADY
from ros_visualise.estimation.mapping.rig import CalibrationError, calibrations_of, cameras_of
from ros_visualise.estimation.mapping.smoothing import SmoothedMap
from ros_visualise.estimation.mapping.unknowns import LARGER, LONGER, PRINTED, UNKNOWN

_LASTING = 1.5  # views that count as one
_WORST = 3  # views, and tags, that are named


def report_lines(made: TagMap, unused: Mapping[str, int]) -> list[str]:
    """The report as text."""
    found = made.smoothed
    return [
        *_summary(found),
        *_scales(found),
        *(one.text for one in made.mountings),
        *(one.text for one in cameras_of(found)),
        *(_calibration(one) for one in calibrations_of(found)),
        *_outliers(made),
        *_doubtful(made),
        *(f"skipped: {number} {reason}" for reason, number in unused.items()),
    ]


def _summary(found: SmoothedMap) -> Iterator[str]:
    """Numbers of views, tags and sightings in the map."""
    problem, sightings = found.problem, len(found.inliers)
    refused = sightings - int(found.inliers.sum())
    seen = len({one.view for one in problem.sightings})
    yield (
        f"smoothed: {counted(seen, 'view')} of {counted(len(found.tags.t), 'tag')},"
        f" {counted(sightings, 'sighting')}, {refused} of them rejected"
    )
    larger, sigma = _shared(found, LARGER)
    successive = f"; successive views share errors, so {found.noise.views:.1f} count as one"
    yield (
        f"corners: rms {_rms(found.residuals_px[found.inliers]):.2f} px; tags appear"
        f" {abs(larger):.2f} +- {sigma:.2f} px too {'large' if larger >= 0 else 'small'}"
        f"{successive if found.noise.views >= _LASTING else ''}"
    )
    if problem.odometry is None and not problem.surveyed:
        yield f"no tf: the map is in the frame of {escaped(problem.names[problem.anchor])}"


def _scales(found: SmoothedMap) -> Iterator[str]:
    """Given values that do not fit: sizes of tags, the survey, the odometry."""
    if found.problem.surveyed or found.problem.distances:
        printed, sigma = _shared(found, PRINTED)
        yield (
            f"tags: {100 * printed:+.2f} +- {100 * sigma:.2f} % larger than their given sizes,"
            " according to the survey"
        )
    factors = {
        "positions": found.noise.survey_position,
        "orientations": found.noise.survey_turn,
    }
    for name, factor in factors.items():
        if factor >= _LASTING:
            yield (
                f"survey: the {name} deviate by {factor:.1f} times the given sigma, and are"
                " weighted accordingly"
            )
    if _is_longer(found):
        longer, sigma = _shared(found, LONGER)
        yield (
            f"distances from odometry are {100 * longer:+.1f} +- {100 * sigma:.1f} % longer than"
            " from tags; check the given tag size, or the scale of the odometry"
        )


def _doubtful(made: TagMap) -> Iterator[str]:
    """Ambiguous tags, and the first views whose sightings mostly do not fit."""
    found = made.smoothed
    for name, open_ in zip(found.problem.names, found.undecided, strict=True):
        if open_:
            yield f"{escaped(name)}: pose ambiguous, since two poses fit its views"
    views = [one for one in _views(made) if one["refused"] * 2 > one["sightings"] > 1]
    for one in views[:_WORST]:
        yield (
            f"view at {one['stamp']:.2f} s: {one['refused']} of its {one['sightings']} sightings"
            " disagree with the map"
        )


def _calibration(one: CalibrationError) -> str:
    """A sentence for the report."""
    focal, sigma = 100 * one.off[:2] / one.given[:2], 100 * one.sigma[:2] / one.given[:2]
    return (
        f"calibration of {escaped(one.name)}: according to the views, the focal length is off by"
        f" {focal.mean():+.2f} +- {sigma.max():.2f} %, the principal point by"
        f" {one.off[2]:+.1f} {one.off[3]:+.1f} +- {one.sigma[2:4].max():.1f} px"
    )


def _shared(found: SmoothedMap, unknown: int) -> tuple[float, float]:
    """The value and the standard deviation of an unknown that all views share."""
    return float(found.shared[unknown]), float(found.shared_covariance[unknown, unknown] ** 0.5)


def _is_longer(found: SmoothedMap) -> bool:
    """True if the odometry's scale error is larger than expected."""
    is_known = found.problem.odometry is not None
    return is_known and bool(abs(found.shared[LONGER]) > 3 * UNKNOWN.longer)


def _outliers(made: TagMap) -> list[str]:
    """Faulty tags; of those without an explanation, only the worst."""
    explained = [one for one in made.outliers if one.kind != UNSTEADY]
    rest = sorted((one for one in made.outliers if one.kind == UNSTEADY), key=lambda o: -o.value)
    named = [*explained, *rest[:_WORST]]
    names: dict[str, list[str]] = {}
    for one in named:
        names.setdefault(one.text, []).append(escaped(one.name))
    lines = [f"{', '.join(several)}: {text}" for text, several in names.items()]
    if more := rest[_WORST:]:
        lines.append(
            f"{counted(len(more), 'more tag')} with sightings that disagree with the map; see"
            " --json"
        )
    return lines


def report_values(made: TagMap, unused: Mapping[str, int]) -> dict[str, Any]:
    """Report for programs."""
    found = made.smoothed
    return {
        "views": _views(made),
        "landmarks": _landmarks(found),
        "outliers": [
            {"name": one.name, "kind": one.kind, "text": one.text} for one in made.outliers
        ],
        "noise": asdict(found.noise),
        "too_large_px": dict(zip(("value", "sigma"), _shared(found, LARGER), strict=True)),
        "odometry_longer": {
            **dict(zip(("value", "sigma"), _shared(found, LONGER), strict=True)),
            "wrong": _is_longer(found),
        },
        "mountings": [
            {
                "what": one.what,
                "wrong": one.is_wrong,
                "turn_degrees": one.turn_deg.tolist(),
                "turn_sigma_degrees": one.turn_sigma_deg.tolist(),
                "text": one.text,
            }
            for one in made.mountings
        ],
        "cameras": [one.values for one in cameras_of(found)],
        "calibrations": [
            {
                "name": one.name,
                "intrinsics": one.given.tolist(),
                "off": one.off.tolist(),
                "sigma": one.sigma.tolist(),
            }
            for one in calibrations_of(found)
        ],
        "skipped": dict(unused),
    }


def _landmarks(found: SmoothedMap) -> list[dict[str, Any]]:
    sightings = found.problem.sightings
    tags = np.array([one.tag for one in sightings])
    return [
        {
            "name": name,
            **_counts(found, tags == tag),
            "size_m": sightings[int(np.argmax(tags == tag))].size_m,
            "two_poses": bool(found.undecided[tag]),
        }
        for tag, name in enumerate(found.problem.names)
    ]


def _views(made: TagMap) -> list[dict[str, Any]]:
    found = made.smoothed
    views = np.array([one.view for one in found.problem.sightings])
    return [
        {"stamp": int(stamp_ns) / 1e9, **_counts(found, views == view)}
        for view, stamp_ns in enumerate(found.problem.stamps_ns)
        if (views == view).any()
    ]


def _counts(found: SmoothedMap, chosen: npt.NDArray[np.bool_]) -> dict[str, Any]:
    """Numbers of some sightings, and of those that are refused, and the error of the others."""
    return {
        "sightings": int(chosen.sum()),
        "refused": int((~found.inliers[chosen]).sum()),
        "rms_px": _rms(found.residuals_px[chosen & found.inliers]),
    }


def _rms(residuals_px: Any) -> float | None:
    """Root mean square; None for no residuals."""
    return float(np.sqrt((residuals_px**2).mean())) if len(residuals_px) else None
