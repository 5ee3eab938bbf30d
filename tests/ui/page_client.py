"""A browser's side of the page's protocol, for what a real browser would not do."""

from __future__ import annotations

import contextlib
import json
import re
import time
from collections.abc import Callable
from email.message import Message
from http.client import HTTPConnection
from typing import Any

import msgspec
import numpy as np
import viser
import zstandard
from waiting import wait_for
from websockets.sync.client import ClientConnection, connect

from ros_visualise.ui.live.clock import PageClock
from ros_visualise.ui.live.images import ImageHub
from ros_visualise.ui.server.answers import HEADER
from ros_visualise.ui.shell import VISER

TOKEN = "a-token-of-the-tests_00"
VIEW_TOKEN = "another-one-to-look-01"
"""What the pages of these tests are opened with (`conftest.tokens`)."""
CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (0.0, 0.0, 0.0),
    "image_height": 720,
    "image_width": 1280,
    "fov": 1.0,
    "near": 0.1,
    "far": 10.0,
    "look_at": (0.0, 0.0, 1.0),
    "up_direction": (0.0, 0.0, 1.0),
}


_POSES = {"SetPositionMessage": "position", "SetOrientationMessage": "wxyz"}


def addresses(port: int) -> str:
    """What a person reads where a page begins."""
    return (
        f"look at http://127.0.0.1:{port}/{TOKEN} (Ctrl-C ends it)\n"
        f"read-only: http://127.0.0.1:{port}/{VIEW_TOKEN}\n"
    )


def get(port: int, path: str = "/", token: str = TOKEN, **headers: str) -> tuple[int, Message, str]:
    """The status, the headers and the text of an answer."""
    with contextlib.closing(HTTPConnection("127.0.0.1", port, timeout=60)) as asked:
        asked.request("GET", f"/{token}{path}" if token else path, headers=headers)
        answer = asked.getresponse()
        return answer.status, answer.headers, answer.read().decode(errors="replace")


def picture(port: int, name: str) -> str:
    """The SVG of the panel of this name."""
    answer = get(port, f"/?ask={name}", **{HEADER: "1"})
    return json.loads(answer[2])["svg"]


def wait_in(tab: Any, check: Callable[[], Any]) -> Any:
    """What the check gives as soon as it gives something, while a browser's tab works."""
    return wait_for(check, sleep=lambda pause_s: tab.wait_for_timeout(1000 * pause_s))


class Client:
    """Connects as a browser does and knows what it was told of: elements by their
    labels, nodes of the scene by their names."""

    def __init__(
        self, port: int, path: str = f"/{TOKEN}", origin: str | None = None, query: str = ""
    ) -> None:
        self.socket = connect(
            f"ws://127.0.0.1:{port}{path}{VISER}{query}",
            subprotocols=[f"viser-v{viser.__version__}"],
            origin=origin,
            max_size=None,
        )
        self._address = f"ws://127.0.0.1:{port}{path}{ImageHub.path}"
        self._origin = origin
        self._live: ClientConnection | None = None
        self._panels: dict[str, str] = {}  # by their elements
        self.values: dict[str, Any] = {}
        self.html: list[str] = []
        self.images = 0
        self.nodes: dict[str, dict[str, Any]] = {}
        self.plots: dict[str, Any] = {}
        self.commands: list[str] = []  # what the protocol calls them
        self._labels: dict[str, str] = {}
        self.send(CAMERA)

    def send(self, message: dict[str, Any]) -> None:
        """Send one message."""
        self.socket.send(msgspec.msgpack.encode(message))

    @property
    def elements(self) -> list[str]:
        """What the protocol calls all elements."""
        return list(self._labels)

    def uuid(self, label: str) -> str:
        """What the protocol calls an element, the newest of that label."""
        return [uuid for uuid, known in self._labels.items() if known == label][-1]

    def set(self, label: str, value: Any) -> None:
        """Move an element, as soon as it is there; no value is too wild."""
        self.read_until(lambda: label in self._labels.values())
        uuid = self.uuid(label)
        self.values[label] = value  # nobody is told of what they moved themselves
        self.send({"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": value}})

    def read_until(self, check: Callable[[], object], timeout_s: float = 60.0) -> None:
        """Take in what comes until the check holds."""
        end_s = time.monotonic() + timeout_s
        while not check():
            assert time.monotonic() < end_s, f"it did not come about; there is {self.values}"
            with contextlib.suppress(TimeoutError):
                for message in _decode(self.socket.recv(timeout=0.02)):
                    self._take(message)
            with contextlib.suppress(TimeoutError):
                self._take_images()

    def close(self) -> None:
        """Leave."""
        self.socket.close()
        if self._live is not None:
            self._live.close()

    def vanish(self) -> None:
        """Lose the connection without a word."""
        self.socket.socket.close()
        if self._live is not None:
            self._live.socket.close()

    def _take_images(self) -> None:
        """Draw all images that have come."""
        while self._live is not None:
            data = self._live.recv(timeout=0)
            length = int.from_bytes(data[:2], "little")
            self._live.send(json.dumps({"got": data[2 : 2 + length].decode()}))
            self.images += 1

    def _show_images(self, uuid: str, panel: str | None) -> None:
        """Show the image of an element, or remove it."""
        if panel == self._panels.get(uuid):
            return
        self._panels.pop(uuid, None)
        if panel is not None:
            self._panels[uuid] = panel
        if self._live is None:
            self._live = connect(self._address, origin=self._origin, max_size=None)
        self._live.send(json.dumps({"show": dict.fromkeys(self._panels.values(), 640)}))

    def _take(self, message: dict[str, Any]) -> None:
        self._take_node(message)
        if message["type"] == "RegisterCommandMessage":
            self.commands.append(message["uuid"])
        if "uuid" not in message:
            return
        props = message.get("props") or message.get("updates") or {}
        found = re.search('data-image="(.*?)"', str(props.get("content")))
        if found or message["type"] == "GuiRemoveMessage":
            self._show_images(message["uuid"], found and found[1])
        if message["type"] == "GuiRemoveMessage":
            self.values.pop(self._labels.pop(message["uuid"], None), None)
        if props.get("label") and "value" in message:
            self._labels[message["uuid"]] = props["label"]
            self.values[props["label"]] = message["value"]
        elif "value" in props and message["uuid"] in self._labels:
            self.values[self._labels[message["uuid"]]] = props["value"]
        self.html += [props["content"]] if isinstance(props.get("content"), str) else []
        if isinstance(props.get("data"), (list, tuple)):
            self.plots[message["uuid"]] = props["data"]

    def _take_node(self, message: dict[str, Any]) -> None:
        name, kind = message.get("name"), message["type"]
        if name is None:
            return
        if kind == "RemoveSceneNodeMessage":
            self.nodes.pop(name, None)
        elif kind in _POSES:
            self.nodes.setdefault(name, {})[_POSES[kind]] = np.array(message[_POSES[kind]])
        elif kind == "SetSceneNodeVisibilityMessage":
            self.nodes.setdefault(name, {})["visible"] = message["visible"]
        else:
            props = message.get("props") or message.get("updates") or {}
            self.nodes.setdefault(name, {}).update(props)


class ClockClient:
    """A browser's side of the timeline."""

    def __init__(self, port: int, token: str) -> None:
        self._socket = connect(f"ws://127.0.0.1:{port}/{token}{PageClock.path}")
        self._state: dict[str, Any] = {}

    def __enter__(self) -> ClockClient:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def act(self, **action: Any) -> None:
        """Ask for something."""
        self._socket.send(json.dumps(action))

    def read_until(self, check: Callable[[dict[str, Any]], object]) -> dict[str, Any]:
        """Take what comes until the check holds; the state then."""
        while not (self._state and check(self._state)):
            self._state = json.loads(self._socket.recv(timeout=60))
        return self._state


def _decode(packet: bytes) -> list[dict[str, Any]]:
    length = int.from_bytes(packet[8:16], "little")
    packed = zstandard.ZstdDecompressor().decompress(packet[16 : 16 + length])
    content = msgspec.msgpack.decode(packed)
    buffers, start = [], 16 + length
    for size in content["binaryBufferLengths"]:
        start += -start % 8
        buffers.append(packet[start : start + size])
        start += size
    return [_filled(message, buffers) for message in content["messages"]]


def _filled(value: Any, buffers: list[bytes]) -> Any:
    """With flat arrays in the places of what was sent beside the messages."""
    if isinstance(value, list):
        return [_filled(one, buffers) for one in value]
    if not isinstance(value, dict):
        return value
    if "__binary_index" in value:
        return np.frombuffer(buffers[value["__binary_index"]], value["dtype"])
    return {key: _filled(one, buffers) for key, one in value.items()}
