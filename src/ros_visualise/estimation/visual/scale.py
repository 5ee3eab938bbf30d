"""The scale of a camera's motion: by the ground, or by positions that something else measures.

A camera alone shows its way without its size. The known height over the ground gives it, if the
ground is seen. So do positions, as of GPS or wheels: their spread, at the same moments, is the
factor, whatever their frames are; the spread of noise is subtracted. Both end as distances between
keyframes, which are adjusted with all else.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import deque
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.visual.ground import SeenGround, find_ground
from ros_visualise.estimation.visual.keyframes import Keyframe, KeyframeDistance
from ros_visualise.estimation.visual.stretch import Stretch

_LONGEST = 60  # moments
_SCALES = 3  # measurements that make the first scale
_ALIKE = 0.2  # their spread, as a fraction
_GROUND = 0.025  # error of the height that the ground shows, as a fraction: its bumps
_NORMAL = 0.01  # rad, of the ground's normal from keyframe to keyframe: slopes, and pitching
_GAIN = 0.3  # of what a keyframe shows of it, after the first one
_UNSURE = 0.15  # rad, of the ground's normal at first
_STEPS = 3, 1  # of finding the ground, before the scale is known, and then
_LATER = 2  # keyframes after a view that shows the ground: its pose is better known by then
_BASE = 0.2, 0.8  # heights, least and most distance of two views that show the ground
_LOW = 0.08  # least slope of a ray to the ground, with other guesses of the height: see `_guesses`
_LEAST, _TRIALS = 20, 200  # points, and planes through three of them
_THICK = 0.02  # of a plane, in distances
_UPRIGHT = 0.3  # cosine of the angle between the ground's normal and the way down, at least
_MOST = 0.5  # of the points, on a plane that is the ground
_GUESSES = (0.4, 0.6, 0.75, 0.9)  # quantiles


class MeasuredScale(NamedTuple):
    """Metres for each unit, and the standard deviation as a fraction."""

    factor: float
    sigma: float


class PositionScale:
    """Compares positions with those that something else measures at the same time.

    Args:
        drift: error of the other's distances, as a fraction of them.
    """

    def __init__(self, drift: float = 0.01) -> None:
        self._drift = drift
        self._pairs: deque[tuple[Floats, Floats, float]] = deque(maxlen=_LONGEST)

    def clear(self) -> None:
        """Begin anew: the units have changed."""
        self._pairs.clear()

    def add(self, position: Floats, measured: Floats, sigma: float) -> MeasuredScale | None:
        """Add a position (3,), and the measured one with its standard deviation; the scale."""
        self._pairs.append((position, measured, sigma))
        own, other, sigmas = (np.array(column) for column in zip(*self._pairs, strict=True))
        n = len(own)
        if n < 3:
            return None
        spread = float(((own - own.mean(axis=0)) ** 2).sum())
        noise = float((sigmas**2).sum()) * 3
        signal = float(((other - other.mean(axis=0)) ** 2).sum()) - noise
        if spread <= 0 or signal <= noise:
            return None
        fraction = np.hypot(np.sqrt(noise / 3 / signal), self._drift) * np.sqrt(n)  # not anew
        return MeasuredScale(float(np.sqrt(signal / spread)), float(fraction))

    def rescale(self, factor: float) -> None:
        """Own positions were multiplied by a factor."""
        pairs = [(own * factor, other, sigma) for own, other, sigma in self._pairs]
        self._pairs = deque(pairs, maxlen=_LONGEST)


class ScaleFinder:
    """Scales the map of a stretch as soon as that is possible, and keeps its scale.

    Args:
        K: (3, 3) of the undistorted images.
        height: of the camera over the ground, metres; 0: unknown.
        down: (3,) direction of the ground in the camera's axes, as far as it is known.
        has_positions: positions will come.
    """

    def __init__(self, K: Floats, height: float, down: Floats, has_positions: bool) -> None:
        self.is_needed = bool(height) or has_positions
        self._K, self._height = K, height
        self._down = down / np.linalg.norm(down)
        self._positions: deque[tuple[int, Floats, float]] = deque(maxlen=2000)
        self.restart()

    def add(self, stamp_ns: int, position: Floats, sigma: float) -> None:
        """Note a measured position (3,), in any frame, and its standard deviation."""
        self._positions.append((stamp_ns, position, sigma))

    def restart(self) -> None:
        """Begin with a new map."""
        self._other = PositionScale()
        self._waiting: list[tuple[int, Floats]] = []
        self._ratios: list[float] = []
        self._normal, self._normal_sigma = self._down, _UNSURE

    def look(self, stretch: Stretch) -> None:
        """Measure by the newest keyframe, which is adjusted."""
        frames = stretch.window.frames
        if not self.is_needed or len(frames) < 2 + _LATER:
            return
        found = self._by_ground(stretch) if self._height else None
        by_positions = self._by_positions(stretch)
        for one in (found, by_positions):
            if one is not None:
                self._use(stretch, one)

    def _use(self, stretch: Stretch, one: KeyframeDistance) -> None:
        if stretch.in_metres:
            stretch.window.distances.append(one)
            return
        a, b = stretch.window.frame(one.first), stretch.window.frame(one.second)
        self._ratios.append(one.length / float(np.linalg.norm(b.p - a.p)))
        last = self._ratios[-_SCALES:]
        factor = float(np.median(last))
        if len(last) == _SCALES and max(last) - min(last) < _ALIKE * factor:
            stretch.scale(factor)
            self._other.rescale(factor)
            self._waiting = [(stamp_ns, p * factor) for stamp_ns, p in self._waiting]
            stretch.in_metres = True

    def _by_ground(self, stretch: Stretch) -> KeyframeDistance | None:
        """A distance by the height over the ground."""
        *others, newest = stretch.window.frames[:-_LATER]
        best: tuple[SeenGround, Keyframe] | None = None
        known = [(self._normal, self._height)]
        for normal, height in known if stretch.in_metres else self._guesses(stretch):
            base = _base(others, newest, height)
            R, t = newest.R.T @ base.R, newest.R.T @ (base.p - newest.p)
            n = base.R.T @ normal
            spread = np.eye(3) * self._normal_sigma**2 + np.outer(n, n)
            guess = SeenGround(n / height, spread / height**2)
            steps = _STEPS[stretch.in_metres]
            found = find_ground(base.gray, newest.gray, self._K, R, t, guess, steps)
            if found is not None and (best is None or found.patches > best[0].patches):
                best = found, base
        if best is None:
            return None
        plane, base = best
        fraction = float(np.hypot(_GROUND, plane.height_sigma / plane.height))
        self._keep_normal(base.R @ plane.normal)
        length = float(np.linalg.norm(newest.p - base.p)) * self._height / plane.height
        return KeyframeDistance(base.key, newest.key, length, length * fraction)

    def _guesses(self, stretch: Stretch) -> list[tuple[Floats, float]]:
        """Normals, and heights in units of the map, that its points show."""
        newest = stretch.window.frames[-1 - _LATER]
        points = stretch.window.positions() - newest.p
        found = _plane_of(points, self._normal)
        depth = points @ self._normal
        below = depth > _LOW * np.linalg.norm(points, axis=1)
        heights = np.quantile(depth[below], _GUESSES).tolist() if below.any() else []
        return [*found, *((self._normal, height) for height in heights)]

    def _keep_normal(self, normal: Floats) -> None:
        gain = 1.0 if self._normal_sigma == _UNSURE else _GAIN
        kept = self._normal + gain * (normal - self._normal)
        self._normal, self._normal_sigma = kept / np.linalg.norm(kept), _NORMAL

    def _by_positions(self, stretch: Stretch) -> KeyframeDistance | None:
        """A distance by all positions that were measured so far."""
        *_, before, newest = stretch.window.frames
        self._waiting.append((newest.stamp_ns, newest.p - stretch.offset))
        scale: MeasuredScale | None = None
        while self._positions and self._waiting:
            stamp_ns, own = self._waiting[0]
            measured = self._measured_at(stamp_ns)
            if measured is None and self._positions[-1][0] < stamp_ns:
                break
            self._waiting.pop(0)
            if measured is not None:
                scale = self._other.add(own, *measured)
        if scale is None:
            return None
        length = float(np.linalg.norm(newest.p - before.p)) * scale.factor
        return KeyframeDistance(before.key, newest.key, length, length * scale.sigma)

    def _measured_at(self, stamp_ns: int) -> tuple[Floats, float] | None:
        """The position at a time, interpolated; None outside of what is measured."""
        stamps = [one[0] for one in self._positions]
        after = bisect_left(stamps, stamp_ns)
        if after == len(stamps) or (after == 0 and stamps[0] != stamp_ns):
            return None
        end = self._positions[after]
        start = self._positions[max(after - 1, 0)]
        part = (stamp_ns - start[0]) / max(end[0] - start[0], 1)
        return start[1] + part * (end[1] - start[1]), max(start[2], end[2])


def _plane_of(points: Floats, down: Floats) -> list[tuple[Floats, float]]:
    """The normal and distance of a plane with most of the points (N, 3), if there is one."""
    if len(points) < _LEAST:
        return []
    chosen = np.random.default_rng(0).integers(len(points), size=(_TRIALS, 3))
    a, b, c = (points[chosen[:, n]] for n in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-12)[:, None]
    normals *= np.where((normals * a).sum(axis=1) < 0, -1, 1)[:, None]
    heights = (normals * a).sum(axis=1)
    thick = _THICK * np.linalg.norm(points, axis=1)
    on = (np.abs(points @ normals.T - heights) < thick[:, None]).mean(axis=0)
    on[normals @ down < _UPRIGHT] = 0
    best = int(np.argmax(on))
    return [(normals[best], float(heights[best]))] if on[best] > _MOST else []


def _base(others: list[Keyframe], newest: Keyframe, height: float) -> Keyframe:
    """The oldest keyframe not too far from the newest one to show the ground, or the last one."""
    away = [float(np.linalg.norm(one.p - newest.p)) for one in others]
    near = [one for one, far in zip(others, away, strict=True) if far < _BASE[1] * height]
    return near[0] if near else others[-1]
