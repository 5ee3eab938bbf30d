"""The tree of frames over time, as in tf2."""

from __future__ import annotations

import threading
from bisect import bisect_left
from collections.abc import Callable, Container, Iterator, Sequence
from typing import NamedTuple

from ros_visualise.core.errors import NoTransform
from ros_visualise.core.printing import in_seconds
from ros_visualise.data import Floats, Transforms, TransformStamped
from ros_visualise.geometry import rigid
from ros_visualise.geometry.rigid import IDENTITY, Pose, interpolate

_S = 1_000_000_000

MOST_FRAMES = 10_000
"""Maximum number of frames, for graphs that create new names all the time."""


class WrongTransforms(ValueError):
    """Invalid transforms; ``wrong`` holds parent, child and the reason for each."""

    def __init__(self, wrong: Sequence[tuple[str, str, str]]) -> None:
        super().__init__(
            "; ".join(f"{parent!r} -> {child!r} {what}" for parent, child, what in wrong)
        )
        self.wrong = tuple(wrong)


class FrameTree:
    """Transforms between frames over time; thread-safe.

    Args:
        history_s: how far back transforms that move are kept, by their own stamps. Static ones
            hold at all times, for ever.
    """

    def __init__(self, history_s: float = 10.0) -> None:
        self._length_ns = history_s * _S
        self._histories: dict[str, FrameHistory] = {}
        self._lock = threading.Lock()

    def add(self, message: TransformStamped | Transforms, static: bool = False) -> None:
        """Keep transforms; each stands for the time in its own header.

        One that is older than the history of its frame is rejected, as in tf2 (TF_OLD_DATA), and so
        is one that is ahead by more than its length: until a second one of its frame, or another
        frame, shows that time went on. After a jump of time, call `reset`.

        Raises:
            WrongTransforms: frames have no names, hang below themselves, are too many, a transform
                is none, or its time is rejected; the others of the message are kept.
        """
        several = message.transforms if isinstance(message, Transforms) else (message,)
        wrong = []
        with self._lock:
            for one in several:
                try:
                    self._add(one, static)
                except ValueError as error:
                    wrong.append((one.header.frame_id, one.child_frame_id, str(error)))
        if wrong:
            raise WrongTransforms(wrong)

    def lookup(
        self, target: str, source: str, stamp_ns: int | None = None, tolerance_s: float = 0.0
    ) -> Floats:
        """T_target_source, 4x4: takes points in the frame source to the frame target.

        Args:
            target, source: names of frames; of the same one, the identity.
            stamp_ns: the time; between two samples translations go straight and rotations the
                shortest way. None is the newest at which all that is between them is known.
            tolerance_s: how far from a time that is known the nearest one will do.

        Raises:
            NoTransform: a frame is not known, nothing connects the two, or not at that time.
        """
        target, source = _name(target), _name(source)
        with self._lock:
            if stamp_ns is None:
                stamp_ns = self._newest(target, source) or 0
            at = stamp_ns, tolerance_s * _S
            sources = self._climb(source, (target,), *at)
            targets = self._climb(target, sources, *at)
            common = next(reversed(targets))
            if common not in sources:
                raise NoTransform(self._why(target, source, sources, targets, stamp_ns))
        return rigid.to_matrix(rigid.compose(rigid.inverse(targets[common]), sources[common]))

    def newest_ns(self, target: str, source: str) -> int | None:
        """The newest time at which both are connected; None if nothing moves.

        Raises:
            NoTransform: nothing connects the two.
        """
        with self._lock:
            return self._newest(_name(target), _name(source))

    def is_awaited(self, stamp_ns: int, within_s: float, but: Container[str] = ()) -> bool:
        """True if a moving frame is unknown at a time, but was known shortly before.

        Args:
            but: frames that do not count.
        """
        with self._lock:
            several = self._histories.items()
            moving = [h.span_ns[1] for name, h in several if not h.static and name not in but]
        return any(stamp_ns - within_s * _S < newest_ns < stamp_ns for newest_ns in moving)

    def frames(self) -> list[str]:
        """The names of all frames, sorted."""
        with self._lock:
            return sorted(self._names())

    def parent(self, child: str) -> str | None:
        """The last parent of a frame; None for a root and for unknown frames."""
        with self._lock:
            history = self._histories.get(_name(child))
        return history.newest.parent if history else None

    @property
    def roots(self) -> list[str]:
        """The roots, sorted: one if all frames are connected."""
        with self._lock:
            return sorted(self._names() - self._histories.keys())

    def reset(self) -> None:
        """Drop all moving frames: time jumped."""
        with self._lock:
            self._forget()

    def _add(self, one: TransformStamped, static: bool) -> None:
        parent, child = _name(one.header.frame_id), _name(one.child_frame_id)
        if not parent or not child:
            raise ValueError("lacks a frame name")
        if parent == child:
            raise ValueError("is its own parent")
        sample = FrameSample(parent, rigid.pose(one.translation_xyz, one.quat_xyzw))
        history = self._histories.get(child)
        if history is None and len(self._histories) >= MOST_FRAMES:
            raise ValueError(f"exceeds the limit of {MOST_FRAMES} frames")
        if child in self._ancestors(parent):
            raise ValueError("would close a loop of frames")
        if history is None or history.static != static:
            history = self._histories[child] = FrameHistory(static, self._length_ns)
        history.insert(one.header.stamp_ns, sample, self._has_reached)

    def _has_reached(self, stamp_ns: int) -> bool:
        """True if a frame was at about that time, by more than one transform."""
        moving = [one for one in self._histories.values() if not one.static and len(one) > 1]
        return any(stamp_ns <= one.span_ns[1] + self._length_ns for one in moving)

    def _forget(self) -> None:
        self._histories = {name: one for name, one in self._histories.items() if one.static}

    def _climb(
        self, frame: str, until: Container[str], stamp_ns: int, tolerance_ns: float
    ) -> dict[str, Pose]:
        """A frame's ancestors at a time, the nearest first, and T_ancestor_frame.

        Ends at one of ``until``, or where nothing more is known.
        """
        pose = IDENTITY
        found = {frame: pose}
        while frame not in until and frame in self._histories:
            sample = self._histories[frame].at(stamp_ns, tolerance_ns)
            if sample is None or sample.parent in found:
                break
            frame = sample.parent
            pose = found[frame] = rigid.compose(sample.pose, pose)
        return found

    def _ancestors(self, frame: str) -> Iterator[str]:
        """A frame and its ancestors by the newest samples, up to the root."""
        yield frame
        seen = {frame}
        while frame in self._histories:
            frame = self._histories[frame].newest.parent
            if frame in seen:  # of frames that changed parents out of order
                return
            seen.add(frame)
            yield frame

    def _newest(self, target: str, source: str) -> int | None:
        above_source, above_target = list(self._ancestors(source)), list(self._ancestors(target))
        common = next((frame for frame in above_source if frame in above_target), None)
        if common is None:
            raise NoTransform(self._unconnected(target, source))
        between = [
            self._histories[frame]
            for chain in (above_source, above_target)
            for frame in chain[: chain.index(common)]
        ]
        return min((one.span_ns[1] for one in between if not one.static), default=None)

    def _names(self) -> set[str]:
        return self._histories.keys() | {one.newest.parent for one in self._histories.values()}

    def _why(
        self,
        target: str,
        source: str,
        sources: dict[str, Pose],
        targets: dict[str, Pose],
        stamp_ns: int,
    ) -> str:
        if not {target, source} <= self._names():
            return self._unconnected(target, source)
        unknown_then = [
            f"{frame} is known from {in_seconds(span[0])} to {in_seconds(span[1])} s"
            for frame in (next(reversed(sources)), next(reversed(targets)))
            if frame in self._histories and not self._histories[frame].static
            for span in (self._histories[frame].span_ns,)
        ]
        if not unknown_then:
            return self._unconnected(target, source)
        what = f"no transform from {source} to {target} at {in_seconds(stamp_ns)} s"
        return f"{what}: {', '.join(unknown_then)}"

    def _unconnected(self, target: str, source: str) -> str:
        names = self._names()
        if not names:
            return f"no transform from {source} to {target}: no transforms yet"
        absent = [repr(name) for name in (source, target) if name not in names]
        if absent:
            why = f"no frame {' or '.join(absent)}; known frames: {', '.join(sorted(names))}"
        else:
            tops = [list(self._ancestors(name))[-1] for name in (source, target)]
            why = f"separate trees: {source} is below {tops[0]}, but {target} is below {tops[1]}"
        return f"no transform from {source} to {target}: {why}"


def _name(frame: str) -> str:
    return frame.lstrip("/")


class FrameSample(NamedTuple):
    """The frame's parent at a time, and T_parent_frame."""

    parent: str
    pose: Pose


class FrameHistory:
    """Samples of one frame in its parent in order of time; only the last one if static.

    Args:
        static: the transform is valid at all times.
        length_ns: samples older than the newest by more than this are dropped.
    """

    def __init__(self, static: bool, length_ns: float) -> None:
        self.static = static
        self._length_ns = length_ns
        self._stamps_ns: list[int] = []
        self._samples: list[FrameSample] = []
        self._stray: tuple[int, FrameSample] | None = None  # far from these; a second one decides

    @property
    def newest(self) -> FrameSample:
        """The newest sample."""
        return self._samples[-1]

    @property
    def span_ns(self) -> tuple[int, int]:
        """The times of its first and its newest sample."""
        return self._stamps_ns[0], self._stamps_ns[-1]

    def __len__(self) -> int:
        return len(self._stamps_ns)

    def insert(self, stamp_ns: int, sample: FrameSample, is_reached: Callable[[int], bool]) -> None:
        """Add a sample at its place; it replaces another of the same time.

        Args:
            stamp_ns: its time.
            sample: the transform.
            is_reached: True for a time that other frames confirm.

        Raises:
            ValueError: its time is too far from the newest, and nothing confirms it yet.
        """
        if self.static:
            self._stamps_ns, self._samples = [stamp_ns], [sample]
            return
        stray, self._stray = self._stray, None
        off_ns = stamp_ns - self._stamps_ns[-1] if self._stamps_ns else 0
        if off_ns < -self._length_ns or (off_ns > self._length_ns and not is_reached(stamp_ns)):
            how = "older than" if off_ns < 0 else "ahead of"
            why = f"is more than {self._length_ns / _S:g} s {how} the newest transform"
            if off_ns < 0 and len(self) > 1:
                raise ValueError(why)
            if stray is None or self._is_apart(stamp_ns - stray[0], off_ns):
                self._stray = stamp_ns, sample
                raise ValueError(why)
            if off_ns < 0:
                self._stamps_ns, self._samples = [], []
            self._put(*stray)
        self._put(stamp_ns, sample)

    def _is_apart(self, since_ns: int, off_ns: int) -> bool:
        """True if two far samples disagree; ahead, time may have gone on by any amount."""
        return since_ns < -self._length_ns or (off_ns < 0 and since_ns > self._length_ns)

    def _put(self, stamp_ns: int, sample: FrameSample) -> None:
        place = bisect_left(self._stamps_ns, stamp_ns)
        if place < len(self._stamps_ns) and self._stamps_ns[place] == stamp_ns:
            self._samples[place] = sample
            return
        self._stamps_ns.insert(place, stamp_ns)
        self._samples.insert(place, sample)
        self._forget()

    def at(self, stamp_ns: int, tolerance_ns: float) -> FrameSample | None:
        """The sample at a time, interpolated; None further than the tolerance from the span.

        Beyond its ends the nearest holds; between two parents the earlier does, as in tf2.
        """
        stamps_ns, samples = self._stamps_ns, self._samples
        if self.static:
            return samples[0]
        place = bisect_left(stamps_ns, stamp_ns)
        if place == len(stamps_ns):
            return samples[-1] if stamp_ns - stamps_ns[-1] <= tolerance_ns else None
        after = samples[place]
        if stamps_ns[place] == stamp_ns:
            return after
        if place == 0:
            return after if stamps_ns[0] - stamp_ns <= tolerance_ns else None
        before, start = samples[place - 1], stamps_ns[place - 1]
        if before.parent != after.parent:
            return before
        fraction = (stamp_ns - start) / (stamps_ns[place] - start)
        return FrameSample(before.parent, interpolate(before.pose, after.pose, fraction))

    def _forget(self) -> None:
        oldest_ns = self._stamps_ns[-1] - self._length_ns
        if self._stamps_ns[0] < oldest_ns:
            count = next(i for i, stamp in enumerate(self._stamps_ns) if stamp >= oldest_ns)
            del self._stamps_ns[:count], self._samples[:count]
