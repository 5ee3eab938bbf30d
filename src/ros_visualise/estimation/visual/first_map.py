"""The first map of a camera: from two views with enough parallax, checked by a third."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats, Pixels
from ros_visualise.estimation.resting import Indices
from ros_visualise.estimation.visual.background import MOVING_THINGS, background_rests
from ros_visualise.estimation.visual.keyframes import KeyframeDistance
from ros_visualise.estimation.visual.sights import CameraSights, SeenImage
from ros_visualise.estimation.visual.starting import FirstMotion, first_motions
from ros_visualise.estimation.visual.stretch import VisualPose
from ros_visualise.estimation.visual.turning import TURNING, only_turned
from ros_visualise.estimation.visual.window import KeyframeWindow
from ros_visualise.geometry import se3

LEAST_USED, AGREED = 12, 0.5
"""Fewest points that locate an image, and the least fraction of those in view."""
NOWHERE: tuple[Floats, Floats] = np.eye(3), np.zeros(3)
"""The pose where a map begins."""
_EXACT, _WEAK = 1e-3, 0.3  # fractions: of a baseline that defines the unit, or is replaced
_FLAT, _ALONG = 0.04, 0.85  # thickness of a plane, by its depth; cosine of a way along its normal
_AS_GOOD = 1.15  # residuals of two first motions that cannot be told apart
_ALIKE = 0.1  # fraction by which corners move on, before a motion that failed is tried again
_MOST_WAITING = 600  # images between the first two keyframes
_NO_PIXELS: Pixels = np.zeros((0, 0), np.uint8)


class MapBegins(NamedTuple):
    """A map of two views, the stamp of the first, and poses of the images between them."""

    window: KeyframeWindow
    first_ns: int
    between: list[VisualPose]


class MapWaits(NamedTuple):
    """Why there is no map yet; empty if no reason is known. ``is_over``: start waiting again."""

    reason: str
    is_over: bool


class FirstMap:
    """Waits for the first motion, see the module.

    Args:
        sights: of the camera.
        sigma: standard deviation of directions.
        cameras: T_left_camera (C, 4, 4).
        is_guessed: the calibration is a guess.
    """

    def __init__(
        self, sights: CameraSights, sigma: float, cameras: Floats, is_guessed: bool
    ) -> None:
        self._sights, self._sigma, self._cameras = sights, sigma, cameras
        self._is_guessed = is_guessed
        self._first: SeenImage | None = None
        self._waiting: deque[SeenImage] = deque(maxlen=_MOST_WAITING)
        self._failed = 0.0, ""

    def look(
        self, image: SeenImage, before_ns: int, speed: float, is_weak: bool
    ) -> MapBegins | MapWaits:
        """The first map, if this image shows a motion since the first one.

        Args:
            before_ns: stamp of the image before.
            speed: of the camera, which gives the unit of length; 0: unknown.
            is_weak: something else will give that unit.
        """
        first = self._first
        if first is None:
            return MapWaits("", True)
        if self._sights.readout_s and first.stamp_ns == before_ns:
            self._first = first = self._sights.at_stamp(first, image)
        common, a, b = np.intersect1d(first.corners.ids, image.corners.ids, return_indices=True)
        motions = self._first_motions(first.rays[a], image.rays[b])
        if isinstance(motions, str):
            if len(common) <= 0.5 * len(first.corners.ids):
                return MapWaits(motions, True)
            return self._go_on(image, motions)
        if not self._waiting:  # a third view, which checks what two show
            return self._go_on(image, "")
        length = speed * (image.stamp_ns - first.stamp_ns) / 1e9 or 1.0
        unit = length, length * (_WEAK if is_weak or speed else _EXACT)
        windows = [self._first_window(first, image, a, b, one, unit) for one in motions]
        scores = [self._misfit(one) for one in windows]
        if min(scores) > 1:
            return MapWaits("no rigid motion fits", True)
        turns = [np.linalg.norm(se3.rotation_vector(one.newest.R)) for one in windows]
        good = [n for n, score in enumerate(scores) if score < _AS_GOOD * min(scores)]
        window = windows[min(good, key=lambda n: turns[n])]  # of a plane's, the likely one
        if _is_ambiguous(window):
            return self._go_on(image, "waiting for sideways motion")
        if background_rests(first.gray, image.gray, at_first=True):
            return MapWaits(MOVING_THINGS, True)
        return MapBegins(window, first.stamp_ns, self._located(window, first.stamp_ns))

    def restart(self, image: SeenImage | None) -> None:
        """Wait for a motion from an image on, or from the next one."""
        self._first = image
        self._failed = 0.0, ""
        self._waiting.clear()

    def _go_on(self, image: SeenImage, reason: str) -> MapWaits:
        self._waiting.append(image._replace(gray=_NO_PIXELS))
        return MapWaits(reason, False)

    def _first_motions(self, first: Floats, second: Floats) -> list[FirstMotion] | str:
        """The motions between two views, or why none: the last reason, if little has changed."""
        move = float(np.median(np.linalg.norm(second - first, axis=1))) if len(first) else 0.0
        failed_at, reason = self._failed
        if reason and abs(move - failed_at) < _ALIKE * failed_at:
            return reason
        motions = first_motions(first, second, self._sigma)
        if not isinstance(motions, str):
            info = self._sights.infos[0]
            guess = float(info.K[0, 0]) / info.width * self._is_guessed
            if not only_turned(first, second, self._sigma, guess):
                return motions
            motions = TURNING
        self._failed = move, motions
        return motions

    def _first_window(
        self,
        first: SeenImage,
        image: SeenImage,
        a: Indices,
        b: Indices,
        motion: FirstMotion,
        unit: tuple[float, float],
    ) -> KeyframeWindow:
        """A map of two views, whose distance is a length with a standard deviation."""
        window = KeyframeWindow(self._sigma, self._cameras)
        a, b = a[motion.agree], b[motion.agree]
        second = motion.R.T, -motion.R.T @ motion.t * unit[0]
        for one, places, (R, p) in ((first, a, NOWHERE), (image, b, second)):
            corners = one.corners.chosen(places)
            seen = one._replace(corners=corners, rays=one.rays[places])
            window.add(self._sights.keyframe(seen, R, p))
        keys = window.frames[0].key, window.newest.key
        window.distances.append(KeyframeDistance(*keys, *unit))
        window.adjust()
        return window

    def _misfit(self, window: KeyframeWindow) -> float:
        """Residual of a first map, and of an image between its views, in standard deviations."""
        middle = self._waiting[len(self._waiting) // 2]
        found = window.locate(*NOWHERE, middle.corners.ids, middle.rays)
        if found is None or found.used < max(LEAST_USED, AGREED * found.seen):
            return np.inf
        return max(window.residual, found.residual * found.seen / found.used) / self._sigma

    def _located(self, window: KeyframeWindow, from_ns: int) -> list[VisualPose]:
        """Poses, in the first keyframe, of the images between it and the second."""
        found = []
        R, p = NOWHERE
        for one in self._waiting:
            at = window.locate(R, p, one.corners.ids, one.rays)
            if one.stamp_ns > from_ns and at is not None and at.used > AGREED * at.seen:
                R, p = at.R, at.p
                found.append(VisualPose(one.stamp_ns, R, p, at.covariance, False))
        self._waiting.clear()
        return found


def _is_ambiguous(window: KeyframeWindow) -> bool:
    """True if the camera moved along the normal of a plane: both motions that fit are then alike.

    A rotation by a few degrees, with a tilted plane and path, fits equally well.
    """
    rays, rho = np.insert(window.points.values[:, :2], 2, 1.0, axis=1), window.points.values[:, 2]
    m: Floats = np.zeros(3)
    w: Floats = np.ones(len(rho))
    off: Floats = np.abs(rho)
    for _ in range(5):  # a plane m'x = 1 is seen at the inverse depths m'ray
        m = np.asarray(np.linalg.lstsq(rays * w[:, None], rho * w, rcond=None)[0])
        off = np.abs(rays @ m - rho)
        w = 1 / (1 + off / max(float(np.median(off)), 1e-12))
    way = window.newest.p - window.frames[0].p
    along = abs(float(m @ way)) / max(float(np.linalg.norm(m) * np.linalg.norm(way)), 1e-12)
    return bool(np.median(off) < _FLAT * np.median(rho) and along > _ALONG)
