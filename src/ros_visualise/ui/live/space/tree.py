"""The tree of nodes, and what has changed in it since a browser heard of it."""

from __future__ import annotations

import json
import struct
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import count
from typing import Any, TypeVar

import numpy as np

from ros_visualise.ui.live.space.nodes import POSE, SpaceNode

_N = TypeVar("_N", bound=SpaceNode)
_MOST_NODES = 20_000
_MOST_BYTES = 256 << 20
_ALIGNED = 8


class SpaceFull(ValueError):
    """More than browsers could draw."""


@dataclass
class _Held:
    """A node in the tree; ``sizes`` are those of its values, bytes."""

    name: str
    number: int
    node: SpaceNode
    above: _Held | None
    below: dict[str, _Held] = field(default_factory=dict)
    sizes: dict[str, int] = field(default_factory=dict)


@dataclass
class _Sent:
    """A node as browsers have it: its values, and the version at which each was set."""

    number: int
    above: int
    kind: str
    name: str
    born: int
    values: dict[str, Any] = field(default_factory=dict)
    versions: dict[str, int] = field(default_factory=dict)


class Reader:
    """A browser that has seen one version of a tree; ``gone`` are nodes that it does not have to
    show any more."""

    def __init__(self, tree: SpaceTree) -> None:
        self.seen = 0
        self.gone: list[int] = []
        self._tree = tree

    def read(self) -> bytes | None:
        """A packet of all that it lacks; None if nothing has changed."""
        return self._tree.read(self)

    def close(self) -> None:
        self._tree.end(self)


class SpaceTree:
    """Named nodes; ``a/b`` moves with the node ``a``, or else with the nearest one above it.

    Threads change it; each change, or each block of `atomic`, is one step for browsers.

    Attributes:
        news: called after each step, from any thread.
        refused: number of values and nodes that were too many.
    """

    def __init__(self, max_bytes: int = _MOST_BYTES, max_nodes: int = _MOST_NODES) -> None:
        self.news: Callable[[], None] = lambda: None
        self.refused = self.nbytes = 0
        self._max_bytes, self._max_nodes = max_bytes, max_nodes
        self._changing = threading.RLock()
        self._depth = 0
        self._numbers = count(1)
        self._held: dict[str, _Held] = {}
        self._by_node: dict[SpaceNode, _Held] = {}
        self._steps: list[Callable[[], None]] = []
        self._sending = threading.Lock()
        self._version = 0
        self._sent: dict[int, _Sent] = {}  # what changed last is last
        self._readers: list[Reader] = []
        self._packed: tuple[int, int, bytes] = (0, 0, b"")

    def add(self, name: str, node: _N) -> _N:
        """Add a node, in place of one of the same name.

        Raises:
            SpaceFull: there is too much.
        """
        with self.atomic():
            if name in self._held:
                self.remove(self._held[name].node)
            if len(self._held) >= self._max_nodes:
                self._refuse(f"more than {self._max_nodes} nodes")
            held = _Held(name, next(self._numbers), node, self._nearest(name))
            values = node.values
            self._weigh(held, values)
            self._held[name] = self._by_node[node] = held
            above = held.above
            if above is not None:
                above.below[name] = held
            number = 0 if above is None else above.number
            self._steps.append(lambda: self._make(held.number, number, node.kind, name, values))
            node.join(self)
        return node

    def change(self, node: SpaceNode, name: str, value: Any) -> None:
        """Set an attribute of a node.

        Raises:
            SpaceFull: there is too much.
        """
        with self.atomic():
            held = self._by_node.get(node)
            if held is not None:
                self._weigh(held, {name: value})
                self._steps.append(lambda: self._set(held.number, {name: value}))

    def remove(self, node: SpaceNode) -> None:
        """Remove a node with all below it."""
        with self.atomic():
            if node in self._by_node:
                held = self._by_node[node]
                if held.above is not None:
                    held.above.below.pop(held.name)
                self._forget(held)

    def clear(self) -> None:
        """Remove everything."""
        with self.atomic():
            for held in [one for one in self._held.values() if one.above is None]:
                self.remove(held.node)

    @contextmanager
    def atomic(self) -> Iterator[None]:
        """One step for browsers, of several changes by this thread."""
        with self._changing:
            self._depth += 1
            try:
                yield
            finally:
                self._depth -= 1
                if not self._depth and self._steps:
                    self._publish()

    def reader(self) -> Reader:
        """A new reader, which gets all changes until it is closed."""
        reader = Reader(self)
        with self._sending:
            self._readers.append(reader)
        return reader

    def read(self, reader: Reader) -> bytes | None:
        """A packet of all that a reader lacks; None if nothing has changed."""
        with self._sending:
            if reader.seen == self._version:
                return None
            if self._packed[:2] != (reader.seen, self._version):
                packet = self._pack(reader.seen, reader.gone)
                self._packed = reader.seen, self._version, packet
            reader.seen, reader.gone = self._version, []
            return self._packed[2]

    def end(self, reader: Reader) -> None:
        """Forget a reader."""
        with self._sending:
            self._readers.remove(reader)

    def _nearest(self, name: str) -> _Held | None:
        """The nearest node above a name."""
        while name := name.rpartition("/")[0]:
            if name in self._held:
                return self._held[name]
        return None

    def _weigh(self, held: _Held, values: Mapping[str, Any]) -> None:
        """Count the bytes of values, unless they are too many."""
        sizes = {name: _size(value) for name, value in values.items()}
        more = sum(size - held.sizes.get(name, 0) for name, size in sizes.items())
        if more > 0 and self.nbytes + more > self._max_bytes:
            self._refuse(f"more than {self._max_bytes >> 20} MiB")
        self.nbytes += more
        held.sizes.update(sizes)

    def _refuse(self, what: str) -> None:
        self.refused += 1
        raise SpaceFull(f"{what} in the 3D view; hide topics, or lower Max points")

    def _forget(self, held: _Held) -> None:
        for below in held.below.values():
            self._forget(below)
        del self._held[held.name], self._by_node[held.node]
        held.node.join(None)
        self.nbytes -= sum(held.sizes.values())
        self._steps.append(lambda: self._drop(held.number))

    def _publish(self) -> None:
        steps, self._steps = self._steps, []
        with self._sending:
            self._version += 1
            for step in steps:
                step()
        self.news()

    def _make(self, number: int, above: int, kind: str, name: str, values: dict[str, Any]) -> None:
        self._sent[number] = _Sent(number, above, kind, name, self._version)
        self._set(number, values)

    def _set(self, number: int, values: Mapping[str, Any]) -> None:
        sent = self._sent.pop(number, None)
        if sent is not None:
            sent.values.update(values)
            sent.versions.update(dict.fromkeys(values, self._version))
            self._sent[number] = sent

    def _drop(self, number: int) -> None:
        born = self._sent.pop(number).born
        for reader in self._readers:
            if reader.seen >= born:
                reader.gone.append(number)

    def _pack(self, seen: int, gone: Sequence[int]) -> bytes:
        changed: list[_Sent] = []
        for sent in reversed(self._sent.values()):
            if max(sent.versions.values()) <= seen:
                break
            changed.append(sent)
        changed.sort(key=lambda sent: sent.number)  # parents before their children
        return _packet(changed, gone, seen)


def _packet(changed: Sequence[_Sent], gone: Sequence[int], seen: int) -> bytes:
    """Changes since a version, as they are sent.

    Length of a header, its JSON, and arrays, all at multiples of 8 bytes. In the header:
    ``made``: [number, number of the node above, kind, name]; ``set``: [number, {name: value}] with
    ``[offset, dtype, *shape]`` in ``arrays`` in place of arrays; ``gone``: numbers; ``moved``: the
    array of rows of number, visible, position, and quaternion w, x, y, z.
    """
    buffers: list[bytes] = []
    at = 0

    def put(value: Any) -> list[Any]:
        nonlocal at
        data = value if isinstance(value, bytes) else value.tobytes()
        shape = [len(value)] if isinstance(value, bytes) else value.shape
        described = [at, "bytes" if isinstance(value, bytes) else str(value.dtype), *shape]
        buffers.append(data.ljust(-(-len(data) // _ALIGNED) * _ALIGNED, b"\0"))
        at += len(buffers[-1])
        return described

    made, values, rows = [], [], []
    for sent in changed:
        fresh = [name for name, version in sent.versions.items() if version > seen]
        if sent.born > seen:
            made.append([sent.number, sent.above, sent.kind, sent.name])
        if any(name in POSE for name in fresh):
            pose = sent.values
            rows.append([sent.number, pose["visible"], *pose["position"], *pose["wxyz"]])
        own = {name: sent.values[name] for name in fresh if name not in POSE}
        arrays = {name: put(value) for name, value in own.items() if _is_array(value)}
        if own:
            plain = {name: value for name, value in own.items() if name not in arrays}
            values.append([sent.number, plain, arrays])
    moved = put(np.array(rows, np.float64).reshape(-1, 9))
    header = json.dumps({"made": made, "set": values, "gone": gone, "moved": moved}).encode()
    header = header.ljust(-(-len(header) // _ALIGNED) * _ALIGNED)
    return b"".join([struct.pack("<Q", len(header)), header, *buffers])


def _is_array(value: Any) -> bool:
    """True for what is sent beside the header."""
    return isinstance(value, np.ndarray | bytes)


def _size(value: Any) -> int:
    """Size of an array or of a text, bytes."""
    if isinstance(value, np.ndarray):
        return int(value.nbytes)
    return len(value) if isinstance(value, bytes | str) else 0
