"""The browsers that show the 3D view: each gets the newest of every node as fast as it draws."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np

from ros_visualise.core.errors import UsageError
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.live.exchange import exchange
from ros_visualise.ui.live.space.nodes import View
from ros_visualise.ui.live.space.shown import ShownScene
from ros_visualise.ui.live.space.tree import SpaceTree
from ros_visualise.ui.scene.controls import Value
from ros_visualise.ui.scene.picking import Ray
from ros_visualise.ui.scene.scene import Scene
from ros_visualise.ui.server.gate import Receive, Scope, Send, Visit

_CREDIT = 2
"""Packets that are on their way to a browser at once."""
_LEAVE_S, _CLOSE_S = 5.0, 0.3
_FARTHEST_M = 1e9


class SpaceHub:
    """Serves browsers the 3D view of the present graph.

    Attributes:
        path: of the WebSocket.
        tree: the nodes.
        urdf: a robot to draw in place of those that topics describe.
        shown: the view of the present graph.
    """

    path = "/live/space"

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.tree = SpaceTree()
        self.tree.news = lambda: self.on_loop(self._wake)
        self.urdf = ""
        self._loop = loop
        self._browsers: set[_SpaceBrowser] = set()
        self.shown: ShownScene | None = None
        self._state = ""
        self._wanted: Mapping[str, Value] = {}

    @property
    def scene(self) -> Scene | None:
        """The scene of the present graph."""
        return None if self.shown is None else self.shown.scene

    @property
    def is_watched(self) -> bool:
        """True while a browser shows it."""
        return bool(self._browsers)

    def show(self, runtime: Runtime | None) -> None:
        """Draw the graph of this runtime from now on, or none; settings stay as they are."""
        if self.shown is not None:
            self._wanted = self.arrangement
            self.shown.close(_LEAVE_S)
            self.shown = None
        self.tree.clear()
        if runtime is None:
            self._tell({})
            return
        self.shown = ShownScene(
            runtime, self.tree, self.urdf, lambda: self.is_watched, self._report, self._tell
        )
        self.apply(self._wanted)

    def close(self) -> None:
        """End the threads."""
        if self.shown is not None:
            self.shown.close(_CLOSE_S)
            self.shown = None

    @property
    def arrangement(self) -> dict[str, Value]:
        """The settings that were changed, and the view if it was moved."""
        if self.shown is None:
            return {}
        moved = self.shown.scene.view.moved or self.shown.scene.view.first
        view = {} if moved is None else {"view": ",".join(f"{one:.2f}" for one in moved)}
        return self.shown.controls.arrangement | view

    def apply(self, arrangement: Mapping[str, Value]) -> None:
        """Apply saved settings.

        Raises:
            UsageError: the view is not six numbers.
        """
        self._wanted = arrangement
        if self.shown is not None:
            self.shown.controls.apply(arrangement)
            if "view" in arrangement:
                self.shown.scene.view.first = _view(str(arrangement["view"]).split(","))

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one browser until it leaves.

        It gets binary packets (`tree`) and JSON: ``state``, ``picked`` and ``say``. It sends
        ``{"got": 1}`` for each packet that it has drawn, ``{"home": 1}``, and ``{"pick": {"ray":
        [...], "id": 1}}``; unless it may only look, ``{"set": {PLACE: VALUE}}``, ``{"view":
        [...]}`` and the topic of a ``goal`` in what it picks.
        """
        visit: Visit = scope["state"]["visit"]
        browser = _SpaceBrowser(self, send, visit.is_viewer)
        browser.tell({"state": json.loads(self._state)} if self._state else {})
        self._browsers.add(browser)
        try:
            await exchange(receive, send, browser.send_all(), browser.hear)
        finally:
            self._browsers.discard(browser)
            browser.reader.close()

    def ask(self, key: object, action: Callable[[ShownScene], object]) -> None:
        """Do something in the scene, on its thread."""
        shown = self.shown
        if shown is not None:
            shown.worker.post(key, partial(action, shown))

    def on_loop(self, action: Callable[[], object]) -> None:
        """Do something on the page's loop; from any thread."""
        with suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(action)

    def _report(self, text: str) -> None:
        self.on_loop(lambda: self._tell_all({"say": text}))

    def _tell(self, state: Mapping[str, Any]) -> None:
        self.on_loop(partial(self._put, json.dumps(state)))

    def _put(self, state: str) -> None:
        if state != self._state:
            self._state = state
            self._tell_all({"state": json.loads(state)})

    def _tell_all(self, message: Mapping[str, Any]) -> None:
        for browser in self._browsers:
            browser.tell(message)

    def _wake(self) -> None:
        for browser in self._browsers:
            browser.wake()


class _SpaceBrowser:
    """One browser; ``reader`` knows what it has of the tree."""

    def __init__(self, hub: SpaceHub, send: Send, is_viewer: bool) -> None:
        self.reader = hub.tree.reader()
        self._hub, self._send, self._is_viewer = hub, send, is_viewer
        self._credit = _CREDIT
        self._texts: dict[str, Any] = {}  # the newest of each kind
        self._news = asyncio.Event()
        self._news.set()

    def wake(self) -> None:
        self._news.set()

    def tell(self, message: Mapping[str, Any]) -> None:
        """Send the newest of such messages."""
        self._texts.update(message)
        self.wake()

    async def send_all(self) -> None:
        while True:
            await self._news.wait()
            self._news.clear()
            texts, self._texts = self._texts, {}
            if texts:
                await self._send({"type": "websocket.send", "text": json.dumps(texts)})
            if self._credit <= 0:
                continue
            packet = self.reader.read()
            if packet is not None:
                self._credit -= 1
                await self._send({"type": "websocket.send", "bytes": packet})

    def hear(self, text: str) -> None:
        """Do what a browser asks; anything else than our panel asks is ignored."""
        with suppress(AttributeError, KeyError, TypeError, ValueError, RecursionError, UsageError):
            (what, value), *_ = json.loads(text).items()
            if what == "got":
                self._credit = min(self._credit + 1, _CREDIT)
                self.wake()
            elif what == "home":
                self._hub.ask("home", lambda shown: shown.scene.reset_view(not self._is_viewer))
            elif what == "pick":
                self._pick(value)
            elif self._is_viewer:
                return
            elif what == "set":
                (place, wanted), *_ = value.items()
                self._hub.ask(("set", str(place)), lambda shown: self._set(shown, place, wanted))
            elif what == "view":
                view = None if value is None else _view(value)
                self._hub.ask("view", lambda shown: setattr(shown.scene.view, "moved", view))

    def _set(self, shown: ShownScene, place: str, value: Any) -> None:
        shown.controls.set(place, value)
        self._hub._tell(shown.state)

    def _pick(self, value: Mapping[str, Any]) -> None:
        goal = "" if self._is_viewer else str(value.get("goal") or "")
        x, y, z, *way = _numbers(value["ray"])
        ray, number = Ray(np.array([x, y, z]), np.array(way)), int(value["id"])
        if not ray.direction.any():
            raise ValueError("a ray without a direction")

        def pick(shown: ShownScene) -> None:
            place, fixed = shown.pick(ray, goal)
            at = None if place is None else place.tolist()
            found = {"id": number, "at": at, "fixed": fixed, "goal": goal}
            self._hub.on_loop(lambda: self.tell({"picked": found}))

        self._hub.ask((self, "pick"), pick)


def _numbers(values: Any) -> View:
    """Six numbers.

    Raises:
        ValueError: they are none.
    """
    numbers = x, y, z, *at = tuple(map(float, values))
    if len(at) != 3 or not all(abs(one) < _FARTHEST_M for one in numbers):  # NaN is not
        raise ValueError("needs six numbers, in metres")
    return x, y, z, at[0], at[1], at[2]


def _view(values: Any) -> View:
    """Position and target of a view.

    Raises:
        UsageError: they are not six numbers.
    """
    try:
        return _numbers([float(one) for one in values])
    except (TypeError, ValueError):
        raise UsageError("view: give six numbers, in metres: x,y,z,x,y,z") from None
