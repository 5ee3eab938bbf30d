"""Places of landmarks on the Earth, gathered while a graph runs: ``landmarks SRC --geo OUT``."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ros_visualise.commands.landmarks.sightings import MessageListener
from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.core.printing import counted
from ros_visualise.data import Detections3D, Floats, NavSatFix
from ros_visualise.graph import Graph
from ros_visualise.graph.landmarks import GEOREFERENCE
from ros_visualise.landmarks.georeferencing.origin import MapOrigin
from ros_visualise.nodes.georeference import geo_places
from ros_visualise.runtime.report import RunReport
from ros_visualise.sinks.files import write_file
from ros_visualise.sinks.geography import GeoPlace, GeoTrack, to_geography

_GATE = 9.21  # 99 % of two dimensions


class PlaceLog:
    """Gathers places of detections, and the track of the camera."""

    def __init__(self, graph: Graph) -> None:
        node = next(one for one in graph.nodes if one.name == GEOREFERENCE)
        takers: dict[str, Callable[[int, Any], None]] = {
            node.outputs["positions"]: self._add,
            node.outputs["map_origin"]: self._keep_origin,
            node.inputs["fix"]: self._add_fix,
        }
        self.listeners: Mapping[str, MessageListener] = {
            topic: MessageListener(take) for topic, take in takers.items()
        }
        self._lock = threading.Lock()
        self._found: list[Detections3D] = []
        self._fixes: list[NavSatFix] = []
        self._origin: MapOrigin | None = None

    def found(self) -> tuple[list[GeoPlace], list[GeoTrack]]:
        """Each thing once, and the tracks of the camera and of things that are followed.

        Those without an id of their own are distinguished by their places.
        """
        origin = self._origin
        if origin is None:
            return [], []
        several: dict[str, list[_Thing]] = {}
        with self._lock:
            found = sorted(self._found, key=lambda one: one.header.stamp_ns)
        for message in found:
            _assign(
                several, geo_places(message.detections, origin, message.header.stamp_ns), origin
            )
        every = [thing for things in several.values() for thing in things]
        followed = [thing.track for thing in every if thing.is_followed]
        return [thing.place(origin) for thing in every], [*self._camera_track(), *followed]

    def _camera_track(self) -> list[GeoTrack]:
        with self._lock:
            fixes = sorted(self._fixes, key=lambda one: one.header.stamp_ns)
        places = np.array([(one.latitude, one.longitude, one.altitude) for one in fixes])
        stamps_ns = np.array([one.header.stamp_ns for one in fixes], np.int64)
        return [GeoTrack("camera", places, stamps_ns)] if len(fixes) > 1 else []

    def _add(self, _: int, message: Detections3D) -> None:
        with self._lock:
            self._found.append(message)

    def _add_fix(self, _: int, message: NavSatFix) -> None:
        if message.status >= 0 and np.isfinite([message.latitude, message.longitude]).all():
            with self._lock:
                self._fixes.append(message)

    def _keep_origin(self, _: int, message: NavSatFix) -> None:
        self._origin = MapOrigin.of(message)


def save_places(path: Path, log: PlaceLog, report: RunReport, overwrite: bool) -> str:
    """Write the file; returns a line on what is in it.

    Raises:
        RosVisualiseError: nothing could be placed, with the reasons.
    """
    figures = report.nodes[GEOREFERENCE]
    rejected: Mapping[str, int] = figures.own["rejected"]
    why = [f"{count} {reason}" for reason, count in rejected.items()]
    why += [f"{counted(n, 'image')} dropped ({one})" for one, n in figures.dropped.items() if n]
    places, tracks = log.found()
    if not places:
        reasons = "; ".join(why) or "no landmarks were detected"
        raise RosVisualiseError(
            f"{path}: not written: no landmark has a geographic position: {reasons}"
        )
    write_file(path, to_geography(path, places, tracks), overwrite)
    beside = f"; not placed: {', '.join(why)}" if why else ""
    return f"ros-visualise: {path}: {counted(len(places), 'place')}{beside}"


class _Thing:
    """One thing in several images."""

    def __init__(self, name: str, kind: str) -> None:
        self.name, self.kind = name, kind
        self.seen: list[GeoPlace] = []
        self._weights: list[float] = []
        self._positions: list[Floats] = []

    def add(self, one: GeoPlace, position: Floats) -> None:
        self.seen.append(one)
        self._positions.append(position)
        self._weights.append(1 / max(float(np.trace(one.covariance_m2[:2, :2])), 1e-9))

    @property
    def mean(self) -> tuple[Floats, Floats]:
        """Position in the map and covariance, as if all errors were the same ones.

        Those of pose, lens and ground are: seeing a thing more often does not place it better.
        """
        weights = np.array(self._weights) / sum(self._weights)
        positions = np.array(self._positions)
        mean = weights @ positions
        several = np.array([one.covariance_m2 for one in self.seen])
        off = positions - mean
        scatter = np.einsum("n,ni,nj->ij", weights, off, off)
        covariance = np.einsum("n,nij->ij", weights, several)
        if np.trace(scatter[:2, :2]) > np.trace(covariance[:2, :2]):
            covariance = covariance + scatter  # it moves, or is several
        return mean, covariance

    @property
    def is_followed(self) -> bool:
        """True if it has an id over time, and was seen more than once."""
        return self.seen[0].name != self.kind and len(self.seen) > 1

    @property
    def track(self) -> GeoTrack:
        """Its places over time."""
        stamps_ns = np.array([one.stamp_ns for one in self.seen], np.int64)
        return GeoTrack(self.name, np.array([one.place for one in self.seen]), stamps_ns)

    def place(self, origin: MapOrigin) -> GeoPlace:
        """All of it; the last place of a thing that is followed, since it may move."""
        if self.is_followed:
            return replace(self.seen[-1], seen=len(self.seen))
        position, covariance = self.mean
        at: Floats = origin.plane.from_enu(position)
        last = self.seen[-1].stamp_ns
        return GeoPlace(self.name, self.kind, at, covariance, len(self.seen), last)


def _assign(several: dict[str, list[_Thing]], found: Sequence[GeoPlace], origin: MapOrigin) -> None:
    """Add the places of one image to the nearest things of their names, one to each."""
    if not found:
        return
    positions = origin.plane.to_enu([one.place for one in found])
    pairs = []
    for n, one in enumerate(found):
        for thing in several.get(one.name, ()):
            mean, covariance = thing.mean
            off = (positions[n] - mean)[:2]
            far = off @ np.linalg.solve(covariance[:2, :2] + one.covariance_m2[:2, :2], off)
            pairs.append((float(far), n, thing))
    taken: dict[int, _Thing] = {}
    for far, n, thing in sorted(pairs, key=lambda pair: pair[0]):
        if far <= _GATE and n not in taken and thing not in taken.values():
            taken[n] = thing
    for n, one in enumerate(found):
        if n not in taken:
            things = several.setdefault(one.name, [])
            number = f" {len(things) + 1}" if things else ""
            taken[n] = _Thing(f"{one.name}{number}", one.kind)
            things.append(taken[n])
        taken[n].add(one, positions[n])
