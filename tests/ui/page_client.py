"""A browser's side of the page's protocol, for what a real browser would not do."""

from __future__ import annotations

import contextlib
import json
import time
from collections.abc import Callable
from email.message import Message
from http.client import HTTPConnection
from typing import Any

from waiting import wait_for
from websockets.sync.client import connect

from ros_visualise.ui.live.clock import PageClock
from ros_visualise.ui.live.images import ImageHub
from ros_visualise.ui.server.answers import HEADER

TOKEN = "a-token-of-the-tests_00"
VIEW_TOKEN = "another-one-to-look-01"
"""What the pages of these tests are opened with (`conftest.tokens`)."""
IMAGES = "document.querySelectorAll('[data-images]').length == 3"
"""In a browser, when all images of the demo are there."""


def addresses(port: int) -> str:
    """What a person reads where a page begins."""
    return (
        f"open http://127.0.0.1:{port}/{TOKEN} (Ctrl-C stops)\n"
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


class ImageClient:
    """A browser's side of the image panels: shows topics, under their names as keys."""

    def __init__(self, port: int, path: str = f"/{TOKEN}", origin: str | None = None) -> None:
        address = f"ws://127.0.0.1:{port}{path}{ImageHub.path}"
        self.socket = connect(address, origin=origin, max_size=None)
        self.topics: list[str] = []
        self.offers: list[dict[str, Any]] = []
        self.shown: dict[str, dict[str, Any]] = {}
        self.images: list[tuple[dict[str, Any], bytes]] = []
        self.answers: dict[int, tuple[dict[str, Any], bytes]] = {}

    def show(self, *topics: str, size: int = 640, **options: Any) -> None:
        """Show these topics and no others."""
        self.shown = {topic: {"topic": topic, "size": size, **options} for topic in topics}
        self.send(show=self.shown)

    def send(self, **message: Any) -> None:
        """Send one message."""
        self.socket.send(json.dumps(message))

    def ask(self, key: str, what: str, *at: float) -> tuple[dict[str, Any], bytes]:
        """Facts and bytes of an answer."""
        number = len(self.answers) + 1
        self.send(ask=number, key=key, what=what, at=at)
        self.read_until(lambda: number in self.answers)
        return self.answers[number]

    def read_until(self, check: Callable[[], object], timeout_s: float = 60.0) -> None:
        """Take in what comes until the check holds."""
        end_s = time.monotonic() + timeout_s
        while not check():
            assert time.monotonic() < end_s, "it did not come about"
            self.take(0.02)

    def take(self, timeout_s: float = 0.0) -> None:
        """Take all that has come, and draw the images."""
        with contextlib.suppress(TimeoutError):
            while True:
                data = self.socket.recv(timeout=timeout_s)
                if isinstance(data, str):
                    self.offers = json.loads(data)["topics"]
                    self.topics = [one["topic"] for one in self.offers]
                    continue
                length = int.from_bytes(data[:4], "little")
                facts, body = json.loads(data[4 : 4 + length]), data[4 + length :]
                if "answer" in facts:
                    self.answers[facts["answer"]] = facts, body
                else:
                    self.images.append((facts, body))
                    self.send(got=facts["key"])


_IMAGES = 4


class Client(ImageClient):
    """A browser that shows the first images of a graph."""

    def take(self, timeout_s: float = 0.0) -> None:
        """Take all that has come, and show more if there is more."""
        super().take(timeout_s)
        if list(self.shown) != self.topics[:_IMAGES]:
            self.show(*self.topics[:_IMAGES])

    def close(self) -> None:
        """Leave."""
        self.socket.close()

    def vanish(self) -> None:
        """Lose the connection without a word."""
        self.socket.socket.close()


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


class Live:
    """A browser's side of a WebSocket of the page that sends lists of messages.

    Attributes:
        state: the newest of each entry of all messages.
        values, unused, first: node -> what was said of its parameters last.
        got: all messages.
    """

    def __init__(self, port: int, path: str, token: str = TOKEN) -> None:
        self.socket = connect(f"ws://127.0.0.1:{port}/{token}{path}", max_size=None)
        self.state: dict[str, Any] = {}
        self.values: dict[str, dict[str, Any]] = {}
        self.unused: dict[str, list[str]] = {}
        self.first: dict[str, dict[str, Any]] = {}
        self.got: list[dict[str, Any]] = []

    def __enter__(self) -> Live:
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()

    def send(self, do: str, **request: Any) -> None:
        """Ask for something."""
        self.socket.send(json.dumps({"do": do, **request}))

    def set(self, node: str, name: str, value: Any) -> dict[str, Any]:
        """Set a parameter; the answer."""
        return self.answer("set", values={node: {name: value}})

    def answer(self, do: str, **request: Any) -> dict[str, Any]:
        """Ask for something that is answered; the answer."""
        number = len(self.got) + 1
        self.send(do, number=number, **request)
        self.read_until(lambda: any(one.get("done") == number for one in self.got))
        return next(one for one in self.got if one.get("done") == number)

    def read_until(self, check: Callable[[], object], timeout_s: float = 60.0) -> None:
        """Take what comes until the check holds."""
        end_s = time.monotonic() + timeout_s
        while not check():
            assert time.monotonic() < end_s, f"it did not come about; there is {self.state}"
            with contextlib.suppress(TimeoutError):
                for message in json.loads(self.socket.recv(timeout=0.02)):
                    self.got.append(message)
                    self.state.update(message)
                    for what in ("values", "unused", "first") if "of" in message else ():
                        getattr(self, what)[message["of"]] = message[what]

    @property
    def last(self) -> str:
        """The text of the newest notice."""
        notices = self.state.get("notices")
        return notices[-1][3] if notices else ""

    def said(self, text: str) -> bool:
        """Whether a notice has this text."""
        return any(text in line[3] for line in self.state.get("notices", []))
