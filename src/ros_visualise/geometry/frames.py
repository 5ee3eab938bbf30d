"""The tree of frames: where they were to one another, as tf2 keeps it."""

from __future__ import annotations

import threading
from collections.abc import Container, Iterator, Sequence

from ros_visualise.core.errors import NoTransform
from ros_visualise.data import Floats, Transforms, TransformStamped
from ros_visualise.geometry import rigid
from ros_visualise.geometry.history import History, Sample
from ros_visualise.geometry.rigid import IDENTITY, Pose

_S = 1_000_000_000

MOST_FRAMES = 10_000
"""Frames that a tree keeps: a graph that makes up new names all the time ends there."""


class WrongTransforms(ValueError):
    """Transforms that are none; ``wrong`` holds parent, child and what is wrong of each."""

    def __init__(self, wrong: Sequence[tuple[str, str, str]]) -> None:
        super().__init__(
            "; ".join(f"{parent!r} -> {child!r} {what}" for parent, child, what in wrong)
        )
        self.wrong = tuple(wrong)


class FrameTree:
    """Transforms between frames over time; all of it may be called from any thread.

    Args:
        history_s: how far back transforms that move are kept, by their own stamps. Static ones
            hold at all times, for ever.
    """

    def __init__(self, history_s: float = 10.0) -> None:
        self._length_ns = history_s * _S
        self._histories: dict[str, History] = {}
        self._lock = threading.Lock()

    def add(self, message: TransformStamped | Transforms, static: bool = False) -> None:
        """Keep transforms; each stands for the time in its own header.

        One that is older than all that is kept of its frame means that time jumped back: all that
        moves is forgotten.

        Raises:
            WrongTransforms: frames have no names, hang below themselves, are too many, or a
                transform is none; the others of the message are kept.
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
        """The newest time at which both are known to one another; None if nothing moves.

        Raises:
            NoTransform: nothing connects the two.
        """
        with self._lock:
            return self._newest(_name(target), _name(source))

    def is_awaited(self, stamp_ns: int, within_s: float, but: Container[str] = ()) -> bool:
        """Whether some frame that moves is not known at a time yet, but was shortly before.

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
        """The frame that a frame was last known in; None for a root, and for one not known."""
        with self._lock:
            history = self._histories.get(_name(child))
        return history.newest.parent if history else None

    @property
    def roots(self) -> list[str]:
        """The frames that are in no other, sorted: one, where all hangs together."""
        with self._lock:
            return sorted(self._names() - self._histories.keys())

    def reset(self) -> None:
        """Forget all that moves: time jumped."""
        with self._lock:
            self._forget()

    def _add(self, one: TransformStamped, static: bool) -> None:
        parent, child = _name(one.header.frame_id), _name(one.child_frame_id)
        if not parent or not child:
            raise ValueError("lacks the name of a frame")
        if parent == child:
            raise ValueError("is a frame in itself")
        sample = Sample(parent, rigid.pose(one.translation_xyz, one.quat_xyzw))
        history = self._histories.get(child)
        if history is None and len(self._histories) >= MOST_FRAMES:
            raise ValueError(f"is one frame too many: {MOST_FRAMES} are kept")
        if history and history.is_before(one.header.stamp_ns):
            self._forget()
            history = None
        if child in self._ancestors(parent):
            raise ValueError("would make a loop")
        if history is None or history.static != static:
            history = self._histories[child] = History(static, self._length_ns)
        history.insert(one.header.stamp_ns, sample)

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
        """A frame and those that it is in by the newest samples, up to the root."""
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
            f"{frame} is known from {_seconds(span[0])} to {_seconds(span[1])} s"
            for frame in (next(reversed(sources)), next(reversed(targets)))
            if frame in self._histories and not self._histories[frame].static
            for span in (self._histories[frame].span_ns,)
        ]
        if not unknown_then:
            return self._unconnected(target, source)
        what = f"no transform from {source} to {target} at {_seconds(stamp_ns)} s"
        return f"{what}: {', '.join(unknown_then)}"

    def _unconnected(self, target: str, source: str) -> str:
        names = self._names()
        absent = [repr(name) for name in (source, target) if name not in names]
        if absent:
            known = f"known are {', '.join(sorted(names))}" if names else "none is known yet"
            why = f"there is no frame {' or '.join(absent)}; {known}"
        else:
            tops = [list(self._ancestors(name))[-1] for name in (source, target)]
            why = f"{source} hangs below {tops[0]} and {target} below {tops[1]}"
        return f"no transform from {source} to {target}: {why}"


def _name(frame: str) -> str:
    return frame.lstrip("/")


def _seconds(stamp_ns: int) -> str:
    return f"{stamp_ns // _S}.{stamp_ns % _S:09d}"
