"""Corners of moving tags in images of a rolling shutter, at the time of the middle row.

Such a camera reads one row after the other, so each corner is seen at its own time. The motion of a
tag since the previous image moves its corners back. What this leaves is part of their covariance:
the readout time where it is unknown, an error along the motion that all corners share; and the
change of the velocity since then, which is estimated from how velocities changed before. Half of
the mean squared change between intervals is the variance at the end of the second one, or more:
a third of the density of a white acceleration times the interval is left, two thirds are seen.
Near corners move faster than far ones, so unknown velocities differ by the extent of the tag in
heights of the image, as at a common field of view. A tag whose corners move at different velocities
is bent, which the fit of a square does not show.

All tags of an image share these errors: one readout time, and one motion of the camera. Who takes
their covariances for independent counts the shared part N times too well for N tags, so it is given
N times as large: for errors `e b_i`, `sum_i N var(e) b_i b_i'` is no less than their joint
covariance (the Cauchy-Schwarz inequality).

Source: P.-E. Forssen, E. Ringaby, Rectifying Rolling Shutter Video from Hand-Held Devices, 2010.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.landmarks.pose.corner_noise import corner_noise
from ros_visualise.landmarks.tags.finder import Tag

_UNKNOWN_S = 0.03 / np.sqrt(3)  # root mean square of unknown readout times, 0 to 30 ms
_OLDEST_S = 0.5  # between images that show a velocity
_SPEED = 0.1  # of a tag at first, heights of the image per second (standard deviation)
_CHANGE = 0.25  # of a velocity from interval to interval at first, as a fraction of it
_BENT = 1 / 6  # of a tag's change of shape, what no homography has (measured)
_WEIGHT, _MEMORY = 4.0, 0.99  # of what is expected at first, observations; and of each later one


@dataclass(frozen=True, eq=False)
class _MovingTag:
    """A tag in the previous image; velocity of its corners (4, 2), pixels/s, None if unknown."""

    tag: Tag
    velocity: Floats | None


class _Variance:
    """Mean square of observations, with a prior given later."""

    def __init__(self) -> None:
        self._sum, self._count = 0.0, 0.0

    def add(self, square: float) -> None:
        self._sum, self._count = _MEMORY * self._sum + square, _MEMORY * self._count + 1

    def of(self, prior: float) -> float:
        return (_WEIGHT * prior + self._sum) / (_WEIGHT + self._count)


class RollingShutter:
    """Moves the corners of the tags of one camera to the time of its images."""

    def __init__(self) -> None:
        self._speed, self._change = _Variance(), _Variance()
        self.reset()

    def reset(self) -> None:
        """Forget the previous image."""
        self._stamp_ns = 0
        self._before: list[_MovingTag] = []

    def at_stamp(
        self, tags: Sequence[Tag], stamp_ns: int, height: int, readout_s: float
    ) -> tuple[Tag, ...]:
        """The tags with their corners, and covariances of these, at the time of the middle row.

        Args:
            tags: of the image with this stamp, which is that of its middle row.
            height: of the image, pixels.
            readout_s: from the first row to the last; negative: unknown.
        """
        interval_s = (stamp_ns - self._stamp_ns) * 1e-9
        before = self._before if 0 < interval_s < _OLDEST_S else []
        seen = [self._follow(tag, before, interval_s, max(readout_s, 0) / height) for tag in tags]
        self._stamp_ns, self._before = stamp_ns, seen
        if readout_s == 0:
            return tuple(tags)
        return tuple(self._moved(one, height, readout_s, len(seen)) for one in seen)

    def _follow(
        self, tag: Tag, before: Sequence[_MovingTag], interval_s: float, row_s: float
    ) -> _MovingTag:
        same = [one for one in before if one.tag.name == tag.name]
        last = min(same, key=lambda one: _apart(one.tag, tag), default=None)
        if last is None:
            return _MovingTag(tag, None)
        away = tag.corners_uv - last.tag.corners_uv
        velocity = away / (interval_s + row_s * away[:, 1:])
        mean = velocity.mean(axis=0)
        self._speed.add(float(mean @ mean) / 2)
        if last.velocity is not None:
            changed = mean - last.velocity.mean(axis=0)
            self._change.add(float(changed @ changed) / 4)
        return _MovingTag(tag, velocity)

    def _moved(self, seen: _MovingTag, height: int, readout_s: float, count: int) -> Tag:
        tag = seen.tag
        known_s, unsure_s = (readout_s, 0.0) if readout_s > 0 else (0.0, _UNKNOWN_S)
        rows = (tag.corners_uv[:, 1:] + 0.5) / height - 0.5
        velocity = np.zeros((4, 2)) if seen.velocity is None else seen.velocity
        mean = velocity.mean(axis=0)
        if seen.velocity is None:
            unsure = self._speed.of((_SPEED * height) ** 2)
        else:
            unsure = self._change.of(float(_CHANGE**2 * mean @ mean / 2))
        by_readout = (unsure_s * rows * velocity).ravel()
        late_s = np.hypot(known_s, unsure_s)
        shift = late_s * np.sqrt(unsure) * np.kron(rows, np.eye(2))
        apart = np.ptp(tag.corners_uv, axis=0).max() / (2 * height)
        bent = _BENT * late_s * np.ptp(rows) * float(np.linalg.norm(velocity - mean)) / 2
        own = np.diag((apart * shift.sum(axis=1)) ** 2 + bent**2)
        given = None if tag.covariance_px2 is None else tag.covariance_px2[None]
        noise = corner_noise(tag.corners_uv[None], 0.0, given)[0] + own
        noise = noise + count * (np.outer(by_readout, by_readout) + shift @ shift.T)
        return replace(
            tag, corners_uv=tag.corners_uv - known_s * rows * velocity, covariance_px2=noise
        )


def _apart(one: Tag, other: Tag) -> float:
    return float(np.hypot(*(one.center_uv - other.center_uv)))
