"""A client that looks at a page: it takes all that comes, as a browser does, and draws nothing.

    python looker.py ADDRESS

Once in a few seconds it prints a line of JSON: bytes that came, how often it had to connect, how
long the page took to answer a ping that waits its turn behind what the page sends, and the longest
of the median latencies that the page shows.
"""

import json
import sys
import time
from contextlib import suppress
from http.cookiejar import CookieJar
from urllib.error import URLError
from urllib.request import HTTPCookieProcessor, build_opener

from websockets.exceptions import WebSocketException
from websockets.sync.client import ClientConnection, connect

EVERY_S = 5.0
MOST_SHOWN = 4
LATENCY = 7  # its column in the figures of a topic, ms


class Looker:
    """One browser's worth of looking at a page: images, and the figures of topics."""

    def __init__(self, address: str) -> None:
        self._opener = build_opener(HTTPCookieProcessor(CookieJar()))
        self._address = address
        self._told = {"bytes": 0, "connected": 0, "answer_ms": None, "latency_ms": None}

    def look(self) -> None:
        """Take what the page sends until it ends."""
        with self._opener.open(self._address) as page:
            page.read()
            where = "ws" + page.geturl().removeprefix("http").rstrip("/")
        with (
            connect(f"{where}/live/images", max_size=None) as images,
            connect(f"{where}/live/topics", max_size=None) as topics,
        ):
            self._told["connected"] += 1
            self._take(images, topics)

    def _take(self, images: ClientConnection, topics: ClientConnection) -> None:
        next_s = time.monotonic() + EVERY_S
        asked_s, answered = 0.0, None
        while True:
            if answered is not None and answered.is_set():
                self._told["answer_ms"] = round((time.monotonic() - asked_s) * 1e3, 1)
                answered = None
            if time.monotonic() > next_s:
                next_s += EVERY_S
                print(json.dumps(self._told), flush=True)
                if answered is None:
                    asked_s, answered = time.monotonic(), images.ping()
            with suppress(TimeoutError):
                self._read_image(images, images.recv(timeout=0.02))
            with suppress(TimeoutError):
                self._read_figures(topics.recv(timeout=0))

    def _read_image(self, images: ClientConnection, packet: str | bytes) -> None:
        self._told["bytes"] += len(packet)
        if isinstance(packet, bytes):
            length = int.from_bytes(packet[:4], "little")
            images.send(json.dumps({"got": json.loads(packet[4 : 4 + length])["key"]}))
            return
        shown = [one["topic"] for one in json.loads(packet)["topics"]][:MOST_SHOWN]
        views = {topic: {"topic": topic, "size": 720, "boxes": True} for topic in shown}
        images.send(json.dumps({"show": views}))

    def _read_figures(self, text: str | bytes) -> None:
        self._told["bytes"] += len(text)
        known = [row[LATENCY] for row in json.loads(text)["rows"] if len(row) > LATENCY]
        known = [value for value in known if value is not None]
        self._told["latency_ms"] = round(max(known), 2) if known else None


def main() -> None:
    looker = Looker(sys.argv[1])
    while True:
        try:
            looker.look()
        except (OSError, URLError, WebSocketException) as error:
            print(f"{type(error).__name__}: {error}", flush=True)
        time.sleep(1)


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        raise SystemExit(130) from None
