"""Surveys in YAML files: positions of tags, and distances between them.

landmarks:
- name: tag36h11_3              # as in a map; a previous map may be used unchanged
  position: [1.2, 0.4, 2.1]     # metres, in the frame of the map
  sigma: 0.01                   # metres: one number, or three along the axes
  orientation: [x, y, z, w]     # optional; the tag's frame is x right, y up, z out of it
  sigma_degrees: 1.0            # of the orientation
distances:
- {between: [tag36h11_3, tag36h11_7], metres: 4.115, sigma: 0.005}   # centre to centre
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ros_visualise.core.errors import OpenError
from ros_visualise.core.yaml_files import MANY_VALUES, open_yaml
from ros_visualise.data import Floats
from ros_visualise.estimation.mapping.problem import DistancePrior, Problem, TagPrior
from ros_visualise.geometry import rotations

_SIGMA_M, _SIGMA_DEG = 0.01, 1.0
_LEAST = 1e-5  # metres, radians: smallest standard deviation


@dataclass(frozen=True, eq=False)
class Survey:
    """Surveyed tags by name, and distances by two names."""

    tags: Sequence[tuple[str, TagPrior]] = ()
    distances: Sequence[tuple[str, str, DistancePrior]] = ()

    def added_to(self, problem: Problem) -> tuple[Problem, list[str]]:
        """A problem with the survey, and the names of tags that were never seen."""
        number = {name: tag for tag, name in enumerate(problem.names)}
        tags = [replace(p, tag=number[name]) for name, p in self.tags if name in number]
        distances = [
            replace(p, tags=(number[a], number[b]))
            for a, b, p in self.distances
            if a in number and b in number
        ]
        named = {name for name, _ in self.tags} | {n for a, b, _ in self.distances for n in (a, b)}
        unseen = sorted(named - number.keys())
        return replace(problem, surveyed=tags, distances=distances), unseen


def read_survey(path: str | Path) -> Survey:
    """Read a survey.

    Raises:
        OpenError: it cannot be read or is invalid; the message says where.
    """
    values = open_yaml(path, "give a YAML file of the survey", MANY_VALUES)
    try:
        if not isinstance(values, dict) or not values.keys() & {"landmarks", "distances"}:
            raise ValueError("give a list of landmarks, a list of distances, or both")
        return Survey(
            [_tag(one, where) for where, one in _each(values, "landmarks")],
            [_distance(one, where) for where, one in _each(values, "distances")],
        )
    except ValueError as error:
        raise OpenError(f"{path}: {error}") from None


def _each(values: dict[str, Any], name: str) -> Iterator[tuple[str, dict[str, Any]]]:
    found = values.get(name) or []
    if not isinstance(found, list):
        raise ValueError(f"{name}: give a list")
    for number, one in enumerate(found, 1):
        where = f"{name}, entry {number}"
        if not isinstance(one, dict):
            raise ValueError(f"{where}: give keys and values")
        yield where, one


def _tag(one: dict[str, Any], where: str) -> tuple[str, TagPrior]:
    name = one.get("name")
    if not isinstance(name, str):
        raise ValueError(f"{where}: tag name missing; give one, such as tag36h11_3")
    pose = one.get("pose", one)
    if not isinstance(pose, dict):
        raise ValueError(f"{where}: pose: give a position and an orientation")
    position = _numbers(where, pose, "position", (3,))
    if "covariance" in pose:
        sigmas = np.sqrt(np.diag(_numbers(where, pose, "covariance", (36,)).reshape(6, 6)))
    else:
        of_place = _numbers(where, one, "sigma", (1, 3), [_SIGMA_M])
        of_turn = np.deg2rad(_numbers(where, one, "sigma_degrees", (1, 3), [_SIGMA_DEG]))
        sigmas = np.concatenate([np.broadcast_to(of_place, 3), np.broadcast_to(of_turn, 3)])
    if not (sigmas >= 0).all():
        raise ValueError(f"{where}: standard deviations must not be negative")
    R = None
    if pose.get("orientation") is not None:
        R = rotations.to_matrix(_numbers(where, pose, "orientation", (4,)))
    sigmas = np.maximum(sigmas, _LEAST)
    return name, TagPrior(-1, position, sigmas[:3], R, sigmas[3:])


def _distance(one: dict[str, Any], where: str) -> tuple[str, str, DistancePrior]:
    between = one.get("between")
    if not isinstance(between, list) or len(between) != 2 or between[0] == between[1]:
        raise ValueError(f"{where}: between: give the names of two tags")
    metres = float(_numbers(where, one, "metres", (1,))[0])
    sigma = float(_numbers(where, one, "sigma", (1,), [_SIGMA_M])[0])
    if metres <= 0 or sigma <= 0:
        raise ValueError(f"{where}: metres and sigma must be positive")
    return str(between[0]), str(between[1]), DistancePrior((-1, -1), metres, sigma)


def _numbers(
    where: str,
    values: dict[str, Any],
    key: str,
    counts: tuple[int, ...],
    default: list[float] | None = None,
) -> Floats:
    given = values.get(key, default)
    try:
        numbers = np.atleast_1d(np.asarray(given, np.float64))
    except (TypeError, ValueError):
        numbers = np.zeros(0)
    if numbers.shape not in [(count,) for count in counts] or not np.isfinite(numbers).all():
        wanted = " or ".join(map(str, counts))
        raise ValueError(f"{where}: {key}: give {wanted} numbers")
    return numbers
