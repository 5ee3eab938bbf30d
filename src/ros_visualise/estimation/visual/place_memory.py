"""Places that a camera knows again while it moves: a bounded memory of views with depths.

A place is a view whose features have depths by the views just before it. Its pose in later views
is a measurement like that of a tag: it says how far the odometry has drifted since, and where the
robot is after it was carried away. What looks like a place counts only if three views in a row
agree, if no other place looks nearly as much like it, and if no odometry drifts that far.

The first sighting of a place is the view itself. Its pose there is exact by definition, so the
place is as uncertain as the robot was, and tells nothing until it is seen again. All its depths err
by one factor, as a tag does whose size is wrong.

Places of a map are in its frame, and those from before an interruption may be anywhere, so places
are compared with each other only within such a part of the memory.

Source: R. Mur-Artal, J. Tardos, ORB-SLAM2, IEEE T-RO 2017 (candidates, geometry, repetition).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ros_visualise.data import CameraInfo, Floats, Pixels
from ros_visualise.estimation.visual.place_file import MOST_PLACES, MappedPlace, PlaceLook
from ros_visualise.estimation.visual.views import (
    LEAST,
    SeenPlace,
    ViewFromPlace,
    inverse_depths,
    twist_covariance,
    view_from,
)
from ros_visualise.geometry import se3
from ros_visualise.landmarks.pose.rays import rays_of
from ros_visualise.vision.places import PlaceFeatures, PlaceIndex, find_features, match_features

_NEW_VIEW, _NEAR = 0.05, 0.8  # parallax of a new view, rad; its quantile: near corners show it
_FEWER = 0.5  # of a view's features in the next, below which that is new
_BESIDE = 8  # views before a place that show its depths
_LEAST_POINTS = 60  # with depths, of a place
_KNOWN = 0.4  # of a place's points in view, below which another place begins
_TRIED = 5  # places, by the index
_OTHER = 0.5  # of the points that agree: another place with more makes a place ambiguous
_AGREEING, _WITHIN = 2, 4  # earlier views that say the same, of so many
_SAME = 0.15, 0.08  # of the depth, and rad: sightings that agree
_DRIFT = 0.1, 0.15  # most of an odometry: of the way, and rad
_OFTEN = 3  # sightings after an interruption, or of a map's place: as many localize the robot
_AGAIN = 0.5  # way between sightings of a place, in its depths: those of fewer err alike
_BESIDE_PLACE = 0.35  # distance of a view from a place, in its depths: farther ones err much more
_OFF, _TURNED = 0.03, (0.01, 0.03)  # standard deviations by wrong depths: of the place, as a part
# of that distance; and of the rotation, rad: at the place, and by that distance in depths
_EXACT = 1e-3, 1e-4  # m and rad: standard deviation of a place in the view that it is
_TURN = 0.03  # rad: standard deviation of the rotation between views, as on a gimbal
_OF_MAP = -1  # the part of the memory whose places are those of a map
_WIDEST = 0.3  # cosine of the angle from the axis up to which a lens is used


class PlaceSighting(NamedTuple):
    """A place in a view: T_camera_place, its covariance, and the points that agree.

    The axes of a place are those of its view, and its origin lies ahead of that by its depth.
    ``covariance`` (6, 6) is of the position and of a rotation about the camera's axes.
    """

    id: int
    R: Floats
    t: Floats
    covariance: Floats
    points: int


@dataclass(eq=False)
class _KnownPlace:
    view: SeenPlace
    look: PlaceLook
    depth: float
    part: int  # number of interruptions before
    seen_at: float  # length of the way at its last sighting
    seen_in: int  # the part of that
    begun_at: float  # length of the way when it was new
    seen: int = 0  # sightings in that part

    @property
    def ahead(self) -> Floats:
        """(3,) its origin, in its axes from its view."""
        return np.array([0.0, 0, self.depth])


class _Found(NamedTuple):
    number: int
    pose: ViewFromPlace


class PlaceMemory:
    """See the module.

    Args:
        info: calibration of the camera.
        most: number of new places; then the one nearest to another is forgotten.
        known: places of a map, which are never forgotten; with them, all are at most MOST_PLACES.

    Attributes:
        counts: numbers of views, places, sightings again, and of those that are ambiguous, or
            farther away than an odometry drifts.
    """

    def __init__(
        self, info: CameraInfo, most: int = 500, known: Iterable[MappedPlace] = ()
    ) -> None:
        known = list(known)
        self._info, self._most = info, min(most, MOST_PLACES - len(known))
        self._focal = float(np.sqrt(info.K[0, 0] * info.K[1, 1]))
        self._size = np.array([info.width, info.height], float)
        self._index = PlaceIndex()
        self._places: dict[int, _KnownPlace] = {}
        self._recent: deque[SeenPlace] = deque(maxlen=_BESIDE)
        self._history: deque[tuple[SeenPlace, list[_Found]]] = deque(maxlen=_WITHIN)
        self._way, self._part, self._newest = 0.0, 0, -1
        names = ("views", "places", "recognized", "ambiguous", "too far")
        self.counts = dict.fromkeys(names, 0)
        for one in known:
            T = one.T_map_view
            self._add(one.look, SeenPlace(0, 0, _features(one.look), one.look.rays,
                                          T[:3, :3], T[:3, 3]), _OF_MAP)  # fmt: skip

    @property
    def looks(self) -> list[PlaceLook]:
        """Appearance of all places."""
        return [one.look for one in self._places.values()]

    def __len__(self) -> int:
        return len(self._places)

    def interrupt(self) -> None:
        """Note that the odometry was lost: it may be anywhere now."""
        self._part += 1
        self._recent.clear()
        self._history.clear()
        self._newest = -1

    def look(self, stamp_ns: int, gray: Pixels, T_odom_camera: Floats) -> list[PlaceSighting]:
        """The places in an image (H, W), uint8; none if it is no new view."""
        view = self._view(stamp_ns, gray, T_odom_camera)
        if len(view.rays) < LEAST or not self._is_new(view):
            return []
        if self._recent:
            self._way += float(np.linalg.norm(view.p - self._recent[-1].p))
        self.counts["views"] += 1
        found = self._candidates(view)
        again = [one for one in found if self._is_confirmed(one, view)]
        self._history.append((view, found))
        sightings: list[PlaceSighting] = []
        is_known = self._is_followed(view)
        for one in again:
            place = self._places[one.number]
            is_known |= len(one.pose.seen) > _KNOWN * len(place.look.inverse)
            if self._is_due(place, one.pose):
                sightings.append(self._sighting(one))
                self.counts["recognized"] += 1
        self._recent.append(view)
        if not is_known:
            sightings += self._begin(view)
        return sightings

    def _view(self, stamp_ns: int, gray: Pixels, T: Floats) -> SeenPlace:
        features = find_features(gray)
        directions = rays_of(features.pixels_uv, self._info).directions
        good = directions[:, 2] > _WIDEST
        rays = directions[good, :2] / directions[good, 2:]
        kept = PlaceFeatures(features.pixels_uv[good], features.descriptors[good])
        return SeenPlace(stamp_ns, 0, kept, rays, T[:3, :3], T[:3, 3])

    def _is_new(self, view: SeenPlace) -> bool:
        """True if the view has changed enough since the last one."""
        if not self._recent:
            return True
        last = self._recent[-1]
        pairs = match_features(last.features, view.features)
        if len(pairs) <= _FEWER * min(len(last.rays), len(view.rays)) / 2:
            return True
        turned = np.insert(last.rays[pairs[:, 0]], 2, 1.0, axis=1) @ (view.R.T @ last.R).T
        away = view.rays[pairs[:, 1]] - turned[:, :2] / turned[:, 2:]
        return float(np.quantile(np.linalg.norm(away, axis=1), _NEAR)) > _NEW_VIEW

    # places seen again

    def _candidates(self, view: SeenPlace) -> list[_Found]:
        """Places that a view shows, the best of each part first."""
        tried = self._index.find(view.features, self._index.count, _TRIED)
        several = [
            _Found(n, pose)
            for n in tried
            if n in self._places and n != self._newest and (pose := self._from(n, view))
        ]
        several.sort(key=lambda one: -len(one.pose.seen))
        parts: dict[int, list[_Found]] = {}
        for one in several:
            parts.setdefault(self._places[one.number].part, []).append(one)
        return [one for part in parts.values() for one in self._alike(part, view)]

    def _alike(self, several: list[_Found], view: SeenPlace) -> list[_Found]:
        """Places that agree with the best one; none if others look nearly as much like it."""
        best = several[0]
        agreeing = [one for one in several if self._agree(one, one.pose, best, view, view)]
        others = [one for one in several if one not in agreeing]
        if any(len(one.pose.seen) > _OTHER * len(best.pose.seen) for one in others):
            self.counts["ambiguous"] += 1
            return []
        if self._is_too_far(best, view):
            self.counts["too far"] += 1
            return []
        return agreeing

    def _from(self, number: int, view: SeenPlace) -> ViewFromPlace | None:
        place = self._places[number]
        return view_from(place.view, place.look.inverse, view, self._focal, self._size)

    def _agree(
        self, one: _Found, pose: ViewFromPlace, other: _Found, at: SeenPlace, other_at: SeenPlace
    ) -> bool:
        """True if two sightings place the first view alike, by the odometry between each two."""
        a, b = self._places.get(one.number), self._places.get(other.number)
        if a is None or b is None or a.part != b.part:
            return False
        T_a = _rigid(a.view) @ se3.inverse(se3.from_parts(pose.R, pose.t))
        T_b = _rigid(b.view) @ se3.inverse(se3.from_parts(other.pose.R, other.pose.t))
        T_b = T_b @ se3.inverse(_rigid(other_at)) @ _rigid(at)
        off = se3.inverse(T_a) @ T_b
        is_near = np.linalg.norm(off[:3, 3]) < _SAME[0] * max(a.depth, b.depth)
        return bool(is_near and np.linalg.norm(se3.rotation_vector(off[:3, :3])) < _SAME[1])

    def _is_too_far(self, one: _Found, view: SeenPlace) -> bool:
        """True if the odometry cannot have drifted by so much since the place was new."""
        place = self._places[one.number]
        if place.part != self._part:
            return False
        T = _rigid(place.view) @ se3.inverse(se3.from_parts(one.pose.R, one.pose.t))
        off = se3.inverse(_rigid(view)) @ T
        way = self._way - place.begun_at + float(np.linalg.norm(one.pose.t))
        far = float(np.linalg.norm(off[:3, 3])) > _DRIFT[0] * way + _SAME[0] * place.depth
        turned = float(np.linalg.norm(se3.rotation_vector(off[:3, :3])))
        return far or turned > _SAME[1] + _DRIFT[1] * np.sqrt(way / max(place.depth, 1e-9) / 10)

    def _is_confirmed(self, one: _Found, view: SeenPlace) -> bool:
        """True if earlier views say the same."""
        votes = sum(
            any(self._agree(one, one.pose, other, view, at) for other in found)
            for at, found in self._history
        )
        return votes >= _AGREEING

    def _is_due(self, place: _KnownPlace, pose: ViewFromPlace) -> bool:
        """True if a sighting is worth something: near enough, and far from the last one."""
        if place.seen_in != self._part:
            place.seen_in, place.seen = self._part, 0
        if place.part != self._part and place.seen < _OFTEN:
            return True
        is_near = float(np.linalg.norm(pose.t)) < _BESIDE_PLACE * place.depth
        return is_near and self._way - place.seen_at > _AGAIN * place.depth

    def _sighting(self, one: _Found) -> PlaceSighting:
        place, pose = self._places[one.number], one.pose
        place.seen_at, place.seen = self._way, place.seen + 1
        t = pose.R @ place.ahead + pose.t
        change = se3.about_itself(t)
        covariance = change @ twist_covariance(pose.seen, self._focal) @ change.T
        away = float(np.linalg.norm(pose.t))
        sigmas = np.repeat([_OFF * away, _TURNED[0] + _TURNED[1] * away / place.depth], 3)
        covariance[np.diag_indices(6)] += sigmas**2
        return PlaceSighting(place.look.id, pose.R, t, covariance, len(pose.seen))

    # new places

    def _is_followed(self, view: SeenPlace) -> bool:
        """True if the newest place still fills much of the view."""
        place = self._places.get(self._newest)
        pose = self._from(self._newest, view) if place else None
        return bool(place and pose and len(pose.seen) > _KNOWN * len(place.look.inverse))

    def _begin(self, view: SeenPlace) -> list[PlaceSighting]:
        """Remember a view as a place, if enough of it has a depth."""
        beside = list(self._recent)[-2::-1]
        inverse = inverse_depths(view, beside, self._focal, _TURN)
        known = inverse > 0
        if known.sum() < _LEAST_POINTS or self._most < 1:
            return []
        self._make_room()
        look = PlaceLook(view.features.descriptors[known], view.rays[known], inverse[known])
        of_place = SeenPlace(view.stamp_ns, 0, _features(look), look.rays, view.R, view.p)
        own = self._add(look, of_place, self._part)
        self._newest = self._index.count - 1
        self.counts["places"] += 1
        sigmas = np.repeat(_EXACT, 3)
        return [PlaceSighting(look.id, np.eye(3), own.ahead, np.diag(sigmas**2), len(look.inverse))]

    def _add(self, look: PlaceLook, view: SeenPlace, part: int) -> _KnownPlace:
        number = self._index.add(view.features)
        place = _KnownPlace(view, look, look.depth, part, self._way, self._part, self._way)
        self._places[number] = place
        return place

    def _make_room(self) -> None:
        """If there are too many new places, forget the one nearest to another of its part."""
        numbers = [n for n, one in self._places.items() if one.part != _OF_MAP]
        if len(numbers) < self._most:
            return
        at = np.array([self._places[n].view.p for n in numbers])
        parts = np.array([self._places[n].part for n in numbers])
        apart = np.linalg.norm(at[:, None] - at, axis=2)
        apart[(parts[:, None] != parts) | np.eye(len(at), dtype=bool)] = np.inf
        number = numbers[int(np.argmin(apart.min(axis=1)))]
        del self._places[number]
        self._index.drop(number)


def _features(look: PlaceLook) -> PlaceFeatures:
    """The features of a place; where they were in its image is not kept."""
    return PlaceFeatures(np.zeros((len(look.rays), 2)), look.descriptors)


def _rigid(view: SeenPlace) -> Floats:
    """T_odom_camera (4, 4) of a view."""
    return se3.from_parts(view.R, view.p)
