"""A browser's side of the 3D view: the nodes by their names, as they were sent."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from websockets.sync.client import connect

from ros_visualise.ui.live.space.hub import SpaceHub


class Nodes(dict[str, dict[str, Any]]):
    """Values of nodes by their names, which packets change."""

    def __init__(self) -> None:
        self._names: dict[int, str] = {}
        self.above: dict[str, str] = {}
        self.made: list[str] = []

    def take(self, packet: bytes) -> None:
        """Change what a packet says."""
        end = 8 + int.from_bytes(packet[:8], "little")
        header, data = json.loads(packet[8:end]), packet[end:]
        assert end % 8 == 0, "arrays are aligned"
        for number in header["gone"]:
            self.pop(self._names.pop(number), None)
        for number, above, kind, name in header["made"]:
            self._names[number] = name
            self.above[name] = self._names.get(above, "")
            self[name] = {"kind": kind}
            self.made.append(name)
        for number, plain, arrays in header["set"]:
            found = {key: _array(data, *described) for key, described in arrays.items()}
            self[self._names[number]].update(plain | found)
        for number, visible, *pose in _array(data, *header["moved"]):
            node = self[self._names[int(number)]]
            node.update(visible=bool(visible), position=np.array(pose[:3]), wxyz=np.array(pose[3:]))


class SpaceClient:
    """Connects as the panel does; it asks for more as soon as it has drawn."""

    def __init__(self, port: int, token: str, is_slow: bool = False) -> None:
        address = f"ws://127.0.0.1:{port}/{token}{SpaceHub.path}"
        self._socket = connect(address, max_size=None)
        self._is_slow = is_slow
        self.nodes = Nodes()
        self.state: dict[str, Any] = {}
        self.picked: list[dict[str, Any]] = []
        self.said: list[str] = []
        self.packets = 0

    def send(self, message: object) -> None:
        self._socket.send(message if isinstance(message, str) else json.dumps(message))

    def set(self, place: str, value: Any) -> None:
        """Set something once it is offered."""
        self.read_until(lambda: place in self.controls)
        self.send({"set": {place: value}})

    @property
    def controls(self) -> dict[str, Any]:
        """Place -> value."""
        return {one["place"]: one["value"] for one in self.state.get("controls", ())}

    def got(self) -> None:
        """Tell that a packet was drawn."""
        self.send({"got": 1})

    def read_until(self, check: Callable[[], object]) -> None:
        """Take what comes until the check holds."""
        end_s = time.monotonic() + 60
        while not check():
            assert time.monotonic() < end_s, f"it did not come about; there is {self.state}"
            self.read(0.05)

    def read(self, timeout_s: float) -> None:
        """Take one message, if it comes."""
        try:
            message = self._socket.recv(timeout=timeout_s)
        except TimeoutError:
            return
        if isinstance(message, bytes):
            self.packets += 1
            self.nodes.take(message)
            if not self._is_slow:
                self.got()
            return
        texts = json.loads(message)
        self.state = texts.get("state", self.state)
        self.picked += [texts["picked"]] if "picked" in texts else []
        self.said += [texts["say"]] if "say" in texts else []

    def close(self) -> None:
        self._socket.close()


def _array(data: bytes, at: int, kind: str, *shape: int) -> Any:
    if kind == "bytes":
        return data[at : at + shape[0]]
    count = int(np.prod(shape))
    return np.frombuffer(data, kind, count, at).reshape(shape)
