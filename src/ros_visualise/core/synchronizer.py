"""Synchronizers: match the messages of a node's inputs by their stamps."""

from __future__ import annotations

from bisect import insort
from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from math import inf
from typing import Any, NamedTuple, Protocol

_KEPT = 100
_KEPT_BYTES = 256 * 2**20


@dataclass(frozen=True)
class Each:
    """Policy: every message alone, as it arrives."""


@dataclass(frozen=True)
class Exact:
    """Policy: one message of every input, all with the same stamp."""


@dataclass(frozen=True)
class Approximate:
    """Policy: one message of every input, the nearest in time, at most ``slop_s`` apart."""

    slop_s: float

    def __post_init__(self) -> None:
        if not (isinstance(self.slop_s, int | float) and 0 <= self.slop_s < inf):
            raise ValueError(f"Approximate({self.slop_s}): give 0 or more seconds")


@dataclass(frozen=True)
class Latest:
    """Policy: every message of the input ``trigger`` with the latest of every other input."""

    trigger: str


SyncPolicy = Each | Exact | Approximate | Latest

EACH = Each()


class Waiting(NamedTuple):
    """A message that waits for a match; ``item`` is the caller's object for it."""

    stamp_ns: int
    order: int  # tie-breaker for equal stamps, so that items are never compared
    item: Any
    nbytes: int


class Synchronizer(Protocol):
    """Matches messages; the same messages in the same order always give the same sets.

    ``dropped`` counts the messages that joined no set, by input and reason.
    """

    dropped: Counter[tuple[str, str]]

    def put(self, port: str, stamp_ns: int, item: Any, nbytes: int = 0) -> list[dict[str, Any]]:
        """Take a message of an input; return the sets (input -> item) that it completes."""

    def end(self, port: str) -> None:
        """Note that an input has ended; drop what can no longer be matched."""

    def finish(self) -> list[dict[str, Any]]:
        """Note that all inputs have ended; return the sets that waited for a nearer match."""

    def reset(self, stamp_ns: int) -> None:
        """Start over: time has jumped to ``stamp_ns``."""


def synchronizer(policy: SyncPolicy, ports: Collection[str]) -> Synchronizer:
    """The synchronizer of a policy, for inputs of these names."""
    if isinstance(policy, Latest):
        return _LatestOfOthers(policy.trigger, ports)
    if isinstance(policy, Each):
        return _OneByOne()
    return _ByStamp(ports, round(policy.slop_s * 1e9) if isinstance(policy, Approximate) else 0)


class _OneByOne:
    """Passes every message on by itself."""

    def __init__(self) -> None:
        self.dropped: Counter[tuple[str, str]] = Counter()

    def put(self, port: str, stamp_ns: int, item: Any, nbytes: int = 0) -> list[dict[str, Any]]:
        return [{port: item}]

    def end(self, port: str) -> None:
        pass

    def finish(self) -> list[dict[str, Any]]:
        return []

    def reset(self, stamp_ns: int) -> None:
        pass


class _LatestOfOthers:
    """Matches each triggering message with the newest one by then, by stamp, of every other."""

    def __init__(self, trigger: str, ports: Collection[str]) -> None:
        self.dropped: Counter[tuple[str, str]] = Counter()
        self._trigger = trigger
        self._others = [port for port in ports if port != trigger]
        self._newest: dict[str, tuple[int, Any]] = {}

    def put(self, port: str, stamp_ns: int, item: Any, nbytes: int = 0) -> list[dict[str, Any]]:
        if port != self._trigger:
            if port in self._newest and stamp_ns < self._newest[port][0]:
                self.dropped[port, "late"] += 1
            else:
                self._newest[port] = stamp_ns, item
            return []
        if len(self._newest) < len(self._others):
            self.dropped[port, "unmatched"] += 1
            return []
        return [{port: item} | {other: self._newest[other][1] for other in self._others}]

    def end(self, port: str) -> None:
        """The latest message of an input stays valid."""

    def finish(self) -> list[dict[str, Any]]:
        return []

    def reset(self, stamp_ns: int) -> None:
        """Messages older than the new time, such as a map sent once, stay valid."""
        self._newest = {p: kept for p, kept in self._newest.items() if kept[0] <= stamp_ns}


class _ByStamp:
    """Matches messages by their stamps, whichever input is ahead.

    The latest of the inputs' oldest messages is the pivot: what is older by more than the slop can
    never be matched. A set is made of what is nearest to the pivot on each input, as soon as no
    nearer one can come. Where messages come in the order of their stamps, the sets depend
    on the stamps alone.
    """

    def __init__(self, ports: Collection[str], slop_ns: int) -> None:
        self.dropped: Counter[tuple[str, str]] = Counter()
        self._slop_ns = slop_ns
        self._waiting: dict[str, list[Waiting]] = {port: [] for port in ports}
        self._ended: set[str] = set()
        self._count = self._nbytes = 0

    def put(self, port: str, stamp_ns: int, item: Any, nbytes: int = 0) -> list[dict[str, Any]]:
        self._count += 1
        self._nbytes += nbytes
        insort(self._waiting[port], Waiting(stamp_ns, self._count, item, nbytes))
        sets = self._sets(is_end=False)
        self._make_room()
        self._drop_partnerless()
        return sets

    def end(self, port: str) -> None:
        self._ended.add(port)
        self._drop_partnerless()

    def finish(self) -> list[dict[str, Any]]:
        sets = self._sets(is_end=True)
        self._drop_all("unmatched")
        return sets

    def reset(self, stamp_ns: int) -> None:
        self._drop_all("stale")

    def _sets(self, is_end: bool) -> list[dict[str, Any]]:
        found = []
        while all(self._waiting.values()):
            pivot_ns = max(waiting[0].stamp_ns for waiting in self._waiting.values())
            if self._drop_before(dict.fromkeys(self._waiting, pivot_ns - self._slop_ns)):
                continue
            if not is_end and any(w[-1].stamp_ns < pivot_ns for w in self._waiting.values()):
                break
            found.append(self._take(self._nearest(pivot_ns)))
        return found

    def _nearest(self, pivot_ns: int) -> dict[str, Waiting]:
        """Nearest message to the pivot of each input; if too far apart, the nearest before it."""
        nearest = {
            port: min(waiting, key=lambda one: abs(one.stamp_ns - pivot_ns))
            for port, waiting in self._waiting.items()
        }
        stamps = [one.stamp_ns for one in nearest.values()]
        if max(stamps) - min(stamps) <= self._slop_ns:
            return nearest
        return {
            port: max(one for one in waiting if one.stamp_ns <= pivot_ns)
            for port, waiting in self._waiting.items()
        }

    def _take(self, chosen: Mapping[str, Waiting]) -> dict[str, Any]:
        self._drop_before({port: one.stamp_ns for port, one in chosen.items()})
        for port, one in chosen.items():
            self._waiting[port].remove(one)
            self._nbytes -= one.nbytes
        return {port: one.item for port, one in chosen.items()}

    def _drop_before(self, stamps_ns: Mapping[str, int]) -> bool:
        """Drop older messages; True if there were any."""
        before = self.dropped.total()
        for port, stamp_ns in stamps_ns.items():
            while self._waiting[port] and self._waiting[port][0].stamp_ns < stamp_ns:
                self._drop_first(port, "unmatched")
        return self.dropped.total() > before

    def _make_room(self) -> None:
        """Drop the oldest where too many messages, or too many bytes, wait for a match."""
        for port, waiting in self._waiting.items():
            if len(waiting) > _KEPT:
                self._drop_first(port, "too many unmatched")
        while self._nbytes > _KEPT_BYTES:
            crowds = [(w[0], port) for port, w in self._waiting.items() if len(w) > 1]
            if not crowds:
                return
            self._drop_first(min(crowds)[1], "too many unmatched")

    def _drop_partnerless(self) -> None:
        """Drop all that waits for an input that has ended and is empty."""
        if any(not self._waiting[port] for port in self._ended):
            self._drop_all("unmatched")

    def _drop_all(self, why: str) -> None:
        for port, waiting in self._waiting.items():
            while waiting:
                self._drop_first(port, why)

    def _drop_first(self, port: str, why: str) -> None:
        self._nbytes -= self._waiting[port].pop(0).nbytes
        self.dropped[port, why] += 1
