"""What is known of each transform of the tree: how often it comes, and how old it is."""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import dataclass
from itertools import pairwise

from ros_visualise.data import TransformStamped

_NS = 1_000_000_000
_KEPT = 50


@dataclass(frozen=True)
class Link:
    """One transform: ``rate_hz`` by its stamps; None where it is static or came only once."""

    parent: str
    child: str
    static: bool
    stamp_ns: int
    rate_hz: float | None


class Links:
    """The links of the tree; all of it may be called from any thread."""

    def __init__(self) -> None:
        self._stamps_ns: dict[str, deque[int]] = {}
        self._ways: dict[str, tuple[str, bool]] = {}
        self._lock = threading.Lock()

    def add(self, one: TransformStamped, static: bool) -> None:
        """Take note of a transform."""
        child = one.child_frame_id.lstrip("/")
        with self._lock:
            self._ways[child] = one.header.frame_id.lstrip("/"), static
            stamps = self._stamps_ns.setdefault(child, deque(maxlen=_KEPT))
            if not stamps or one.header.stamp_ns > stamps[-1]:
                stamps.append(one.header.stamp_ns)

    def forget(self) -> None:
        """Time jumped: count anew."""
        with self._lock:
            for child, stamps in self._stamps_ns.items():
                if not self._ways[child][1]:
                    stamps.clear()

    def all(self) -> list[Link]:
        """Every link, by the name of its child."""
        with self._lock:
            return [
                Link(*self._way(child), stamps[-1], self._rate(child))
                for child, stamps in sorted(self._stamps_ns.items())
                if stamps
            ]

    def _way(self, child: str) -> tuple[str, str, bool]:
        parent, static = self._ways[child]
        return parent, child, static

    def _rate(self, child: str) -> float | None:
        stamps = self._stamps_ns[child]
        times = sum(1 for a, b in pairwise(stamps) if b > a)
        if self._ways[child][1] or not times:
            return None
        return times * _NS / (stamps[-1] - stamps[0])
