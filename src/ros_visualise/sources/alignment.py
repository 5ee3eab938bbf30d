"""Aligning a film with a gyroscope's log by the motion of its images.

The images' rotation and shift from one to the next are regressed on the gyroscope's rotation over
the same time, for every offset; the offset at which it explains most is the likeliest, however the
camera is mounted and whatever its lens. The log of the residuals' determinant is the likelihood.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np

from ros_visualise.core.errors import UsageError
from ros_visualise.core.printing import print_status
from ros_visualise.data import Floats, Imu, Pixels
from ros_visualise.sources.recordings import ImageAt, Recording, readable
from ros_visualise.sources.recordings.joined import JoinedRecording, parse_offsets
from ros_visualise.sources.video import Video

AUTO = "auto"
_WIDTH = 240  # of the images that are compared, pixels
_PARTS, _PART_NS = 6, 10_000_000_000  # of a film
_LEAST = 60  # pairs of images
_POINTS, _TRACKED = 200, 12
_CHUNK = 256
_FINE = 20  # offsets for each image
_MOST, _NOISE = 1.5, 6.0  # of the level of a part; log likelihoods that come about by chance
_CLEAR = 0.7  # levels by which an offset must be better than others
_PIECES, _LEAST_PARTS = 6, 2
_APART = 4.0  # images from the best one to others
_GRID_S = 0.004
_SLOWEST_S = 2.0  # of motions that count


@dataclass(frozen=True)
class Alignment:
    """An offset by which a film is moved, its standard deviation, and its share of the motion."""

    offset_s: float
    sigma_s: float
    explained: float


class NoAlignment(UsageError):
    """The motion of a film does not determine its offset."""


def read_offsets(texts: Sequence[str], joined: JoinedRecording) -> list[float]:
    """The offset of each part, as `parse_offsets`; ``NAME=auto`` aligns a film by its motion.

    Raises:
        UsageError: another form, no such part, or no clear offset.
    """
    automatic = [text for text in texts if text.rpartition("=")[2].strip().lower() == AUTO]
    given = [text for text in texts if text not in automatic]
    offsets = parse_offsets(given, joined)
    for text in automatic:
        moved = parse_offsets([f"{text.rpartition('=')[0]}=1"], joined)
        number = moved.index(1.0)
        joined.move(offsets)
        found = _align(joined, number, text)
        offsets[number] = found.offset_s
        print_status(
            f"ros-visualise: {joined.paths[number].name}: shifted by {found.offset_s:.3f} s"
            f" +- {found.sigma_s:.3f} s, the offset that best explains the motion in the video"
            f" ({100 * found.explained:.0f} % of it)"
        )
    return offsets


def _align(joined: JoinedRecording, number: int, text: str) -> Alignment:
    """The offset of a part: of a film by a gyroscope, else by the first film."""
    films = [n for n, one in enumerate(joined.recordings) if isinstance(one, ImageAt)]
    gyros = [(n, t) for n, one in enumerate(joined.recordings) if (t := _imu_topic(one))]
    is_film = number in films
    film = number if is_film else next(iter(films), None)
    gyro = next((one for one in gyros if (one[0] != number) == is_film), None)
    if film is None or gyro is None or gyro[0] == film:
        raise UsageError(
            f"--offset {text}: needs a video and a log with gyroscope data (/imu/data)"
        )
    shifts_ns = [
        span[0] - one.start_ns for span, one in zip(joined.spans_ns, joined.recordings, strict=True)
    ]
    motion = film_motion(joined.paths[film], shifts_ns[film])
    rates = _rates(joined.recordings[gyro[0]], gyro[1], shifts_ns[gyro[0]])
    try:
        found = align(*motion, *rates)
    except NoAlignment as error:
        raise NoAlignment(f"--offset {text}: {error}; give it in seconds") from None
    sign = 1 if is_film else -1
    return Alignment(sign * found.offset_s, found.sigma_s, found.explained)


def _imu_topic(recording: Recording) -> str:
    """The first topic of inertial measurements; empty: none."""
    topics = recording.topics.items()
    return next((name for name, info in topics if info.type.data_class is Imu), "")


def film_motion(path: Path, shift_ns: int = 0) -> tuple[Floats, Floats]:
    """Times (N, 2) of pairs of images, seconds, and the motion (N, 3) between them per second.

    It is the shift to the right and down, in widths of the image, and the rotation, in radians.
    """
    size = Video(path).info
    height = max(round(_WIDTH * size.height / size.width), 8)
    times: list[tuple[float, float]] = []
    motions: list[Floats] = []
    with closing(Video(path, (_WIDTH, height))) as video:
        length_ns = video.duration_ns or 0
        starts = np.linspace(0, max(length_ns - _PART_NS, 0), _PARTS).astype(int).tolist()
        if length_ns <= _PARTS * _PART_NS:
            starts = [0]
        stop_ns = length_ns + _PART_NS if len(starts) == 1 else _PART_NS
        for start_ns in starts:
            for (t, a), (u, b) in pairwise(_gray(video, start_ns, start_ns + stop_ns)):
                moved = _motion(a, b)
                if moved is not None and u > t:
                    times.append(((t + shift_ns) / 1e9, (u + shift_ns) / 1e9))
                    motions.append(moved / ((u - t) / 1e9))
    return np.array(times).reshape(-1, 2), np.array(motions).reshape(-1, 3)


def _gray(video: Video, start_ns: int, stop_ns: int) -> Iterator[tuple[int, Pixels]]:
    with closing(video.read(start_ns)) as images:
        for time_ns, image in images:
            if time_ns > stop_ns:
                return
            pixels = image.pixels
            yield time_ns, pixels if pixels.ndim == 2 else cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY)


def _motion(before: Pixels, after: Pixels) -> Floats | None:
    """Shift of the middle in widths, and rotation; None without enough that can be followed."""
    points = cv2.goodFeaturesToTrack(before, _POINTS, 0.01, 6)
    if points is None or len(points) < _TRACKED:
        return None
    found, status, _ = cv2.calcOpticalFlowPyrLK(before, after, points, None)  # type: ignore[call-overload]
    is_good = status.ravel() > 0
    if is_good.sum() < _TRACKED:
        return None
    height, width = before.shape
    middle = np.array([width, height]) / 2
    model, _ = cv2.estimateAffinePartial2D(
        points[is_good].reshape(-1, 2) - middle, found[is_good].reshape(-1, 2) - middle
    )
    if model is None:
        return None
    return np.array(
        [model[0, 2] / width, model[1, 2] / width, np.arctan2(model[1, 0], model[0, 0])]
    )


def _rates(recording: Recording, topic: str, shift_ns: int) -> tuple[Floats, Floats]:
    """Times (M,) in seconds and angular velocities (M, 3) of a gyroscope."""
    times, rates = [], []
    for _, stamp_ns, imu in readable(recording, [topic]):
        if imu.angular_covariance[0, 0] != -1 and np.isfinite(imu.angular_xyz).all():
            times.append((stamp_ns + shift_ns) / 1e9)
            rates.append(imu.angular_xyz)
    return np.array(times), np.array(rates).reshape(-1, 3)


def align(pairs_s: Floats, motions: Floats, times_s: Floats, rates: Floats) -> Alignment:
    """The offset by which the film is moved so that its motion is that of the gyroscope.

    Args:
        pairs_s: (N, 2) times of the images of each pair.
        motions: (N, k) motion between them per second.
        times_s: (M,) times of the gyroscope, ascending.
        rates: (M, 3) angular velocities.

    Raises:
        NoAlignment: too little motion, or several offsets that are as good.
    """
    if len(pairs_s) < _LEAST or len(times_s) < _LEAST:
        raise NoAlignment("too few images or gyroscope measurements to align the two")
    period = float(np.median(np.diff(pairs_s, axis=1)))
    origin = float(times_s[0])
    steps = np.diff(times_s, prepend=times_s[0])
    angles = np.cumsum(rates * steps[:, None], axis=0)
    pairs, times = pairs_s - origin, times_s - origin
    quick = _quick(pairs.mean(axis=1), motions)
    low, high = -pairs[:, 0].min(), times[-1] - pairs[:, 1].max()
    half = (pairs[:, 1].max() - pairs[:, 0].min()) / 2
    coarse = np.arange(min(low, high) - half, max(low, high) + half, period / 2)
    fits = _Fits(pairs, quick, times, angles)
    best = float(coarse[np.argmax(fits.scores(coarse))])
    fits = _Fits(pairs, quick, times, angles, fits.quality(best)[1])
    several = fits.parts()
    levels = _levels(np.array([one.scores(coarse) for one in several]))
    total = levels.sum(axis=0)
    best = float(coarse[np.argmax(total)])
    others = total[np.abs(coarse - best) > _APART * period]
    near = np.abs(coarse - best) < 2 * period
    agree = [n for n, level in enumerate(levels) if level[near].max() >= 1]
    if total.max() - others.max(initial=0) < _CLEAR or len(agree) < _LEAST_PARTS:
        raise NoAlignment("its motion fits at several offsets, or at none")
    fine = best + np.arange(-3 * _FINE, 3 * _FINE + 1) * period / _FINE
    found = np.array([several[n].scores(fine) for n in agree])
    offset, sigma = _peak(fine, found.sum(axis=0))
    spread = float(np.std([_peak(fine, one)[0] for one in found]))
    shutter = period / 4  # exposure, and rows one after another
    return Alignment(offset, float(np.hypot(max(sigma, spread), shutter)), fits.quality(offset)[0])


def _levels(scores: Floats) -> Floats:
    """(parts, n) likelihoods of each part of a film above what its other offsets have, limited.

    A single part, as of a take-off, would outweigh all others.
    """
    middle, high = np.percentile(scores, (50, 99), axis=1, keepdims=True)
    levels: Floats = np.clip((scores - middle) / np.maximum(high - middle, _NOISE), 0, _MOST)
    return levels


class _Fits:
    """Regressions of a film's motion on a gyroscope's at offsets."""

    def __init__(
        self, pairs: Floats, motions: Floats, times: Floats, angles: Floats, lasting: float = 0.0
    ) -> None:
        self._pairs, self._all, self._times, self._angles = pairs, motions, times, angles
        self.lasting = lasting
        self._motions = self._new(motions[None])[0]
        even = np.arange(0, times[-1] + _GRID_S, _GRID_S)
        self._even = np.stack([np.interp(even, times, one) for one in angles.T], axis=-1)

    def parts(self) -> list[_Fits]:
        """Those of parts of the film."""
        return [
            _Fits(pairs, motions, self._times, self._angles, self.lasting)
            for pairs, motions in zip(
                np.array_split(self._pairs, _PIECES),
                np.array_split(self._all, _PIECES),
                strict=True,
            )
        ]

    def scores(self, offsets: Floats) -> Floats:
        """(n,) log likelihoods; beyond the ends of the log the gyroscope does not turn."""
        found = [self._chunk(offsets[n : n + _CHUNK]) for n in range(0, len(offsets), _CHUNK)]
        return np.concatenate(found)

    def quality(self, offset: float) -> tuple[float, float]:
        """Share of the motion that is explained, and correlation of residuals one after another."""
        turned = self._turned(np.array([offset]))[0]
        solved, *_ = np.linalg.lstsq(turned, self._motions, rcond=None)
        rest = self._motions - turned @ solved
        explained = 1 - float((rest**2).sum() / (self._motions**2).sum())
        scaled = rest / np.maximum(rest.std(axis=0), 1e-12)
        after = float(np.mean(scaled[1:] * scaled[:-1]))
        return explained, float(np.clip(after, 0.0, 0.98))

    def _new(self, several: Floats) -> Floats:
        """Innovations of (n, N, k): each without the lasting share of the one before."""
        return several[:, 1:] - self.lasting * several[:, :-1]

    def _turned(self, offsets: Floats) -> Floats:
        """(n, N - 1, 3) rotations per second over the pairs of images."""
        at = self._pairs[None] + offsets[:, None, None]
        if len(offsets) > 2 and offsets[1] - offsets[0] > _GRID_S:
            places = np.clip(np.rint(at / _GRID_S), 0, len(self._even) - 1).astype(np.int64)
            angles = self._even[places]  # much faster
        else:
            angles = np.stack([np.interp(at, self._times, one) for one in self._angles.T], axis=-1)
        rates = (angles[:, :, 1] - angles[:, :, 0]) / np.diff(self._pairs, axis=1)
        return self._new(rates - rates.mean(axis=1, keepdims=True))

    def _chunk(self, offsets: Floats) -> Floats:
        turned, motions = self._turned(offsets), self._motions
        normal = np.einsum("nik,nil->nkl", turned, turned) + 1e-9 * np.eye(3)
        mixed = np.einsum("nik,il->nkl", turned, motions)
        total = motions.T @ motions + 1e-12 * np.eye(motions.shape[1])
        rest = total - np.einsum("nkl,nkm->nlm", mixed, np.linalg.solve(normal, mixed))
        _, before = np.linalg.slogdet(total)
        _, after = np.linalg.slogdet(rest)
        return np.asarray(len(motions) / 2 * (before - after))


def _quick(times: Floats, motions: Floats) -> Floats:
    """Motions without the slow part, which comes from the camera's travel."""
    kept = np.empty_like(motions)
    for column in range(motions.shape[1]):
        starts = np.searchsorted(times, times - _SLOWEST_S / 2)
        ends = np.searchsorted(times, times + _SLOWEST_S / 2)
        sums = np.concatenate([[0.0], np.cumsum(motions[:, column])])
        kept[:, column] = motions[:, column] - (sums[ends] - sums[starts]) / (ends - starts)
    limits = 5 * np.median(np.abs(kept), axis=0) / 0.6745 + 1e-12
    clipped = np.clip(kept, -limits, limits)
    return np.asarray(clipped - clipped.mean(axis=0))


def _peak(offsets: Floats, scores: Floats) -> tuple[float, float]:
    """Place and width of the highest point, by a parabola through it and its neighbours."""
    n = int(np.clip(np.argmax(scores), 1, len(scores) - 2))
    step = float(offsets[1] - offsets[0])
    a, b, c = scores[n - 1 : n + 2].tolist()
    bend = a - 2 * b + c
    if bend >= 0:
        return float(offsets[n]), 0.0
    return float(offsets[n]) + step * (a - c) / (2 * bend), step / float(np.sqrt(-bend))
