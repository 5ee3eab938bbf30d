"""A client that looks at a page: it takes all that comes, as a browser does, and draws nothing.

    python looker.py ADDRESS

Once in a few seconds it prints a line of JSON: bytes that came, how often it had to connect, how
long the page took to answer a ping that waits its turn behind what the page sends, and the longest
of the median latencies that the page shows.
"""

import json
import math
import sys
import time
from contextlib import suppress
from http.cookiejar import CookieJar
from urllib.error import URLError
from urllib.request import HTTPCookieProcessor, Request, build_opener

import msgspec
import viser
import zstandard
from websockets.exceptions import WebSocketException
from websockets.sync.client import ClientConnection, connect

EVERY_S = 5.0
MOST_SHOWN = 4
LATENCIES = "ms since the source"
CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (0.0, 0.0, 1.0),
    "fov": 1.0,
    "near": 0.1,
    "far": 10.0,
    "image_height": 950,
    "image_width": 1500,
    "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 0.0, 1.0),
}


class Looker:
    """One browser's worth of looking at a page."""

    def __init__(self, address: str) -> None:
        self._cookies = CookieJar()
        self._opener = build_opener(HTTPCookieProcessor(self._cookies))
        self._address = address
        self._plots: set[str] = set()
        self._live: ClientConnection | None = None
        self._told = {"bytes": 0, "connected": 0, "answer_ms": None, "latency_ms": None}

    def look(self) -> None:
        """Take what the page sends until it ends."""
        with self._opener.open(self._address) as page:
            page.read()
            address = page.geturl()
        protocol = f"viser-v{viser.__version__}"
        where = "ws" + address.removeprefix("http").rstrip("/")
        self._live = connect(
            f"{where}/live/images", max_size=None, additional_headers=self._headers()
        )
        with connect(
            f"{where}/viser",
            subprotocols=[protocol],
            max_size=None,
            additional_headers=self._headers(),
        ) as page:
            self._told["connected"] += 1
            page.send(msgspec.msgpack.encode(CAMERA))
            self._take(page)

    def _headers(self) -> dict[str, str]:
        request = Request(self._address)
        self._cookies.add_cookie_header(request)
        return dict(request.header_items())

    def _take(self, page: ClientConnection) -> None:
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
                    asked_s, answered = time.monotonic(), page.ping()
            self._take_images()
            try:
                packet = page.recv(timeout=0.02)
            except TimeoutError:
                continue
            self._told["bytes"] += len(packet)
            self._read(packet)

    def _take_images(self) -> None:
        """Take all images that have come."""
        with suppress(TimeoutError):
            while self._live is not None:
                image = self._live.recv(timeout=0)
                self._told["bytes"] += len(image)
                if isinstance(image, str):
                    self._show([one["topic"] for one in json.loads(image)["topics"]][:MOST_SHOWN])
                    continue
                length = int.from_bytes(image[:4], "little")
                self._live.send(json.dumps({"got": json.loads(image[4 : 4 + length])["key"]}))

    def _show(self, topics: list[str]) -> None:
        assert self._live is not None
        views = {topic: {"topic": topic, "size": 720, "boxes": True} for topic in topics}
        self._live.send(json.dumps({"show": views}))

    def _read(self, packet: bytes) -> None:
        """Find the latencies among what came."""
        length = int.from_bytes(packet[8:16], "little")
        packed = zstandard.ZstdDecompressor().decompress(packet[16 : 16 + length])
        content = msgspec.msgpack.decode(packed)
        for message in content["messages"]:
            told = message.get("props") or message.get("updates") or {}
            if told.get("title") == LATENCIES:
                self._plots.add(message["uuid"])
            elif message.get("uuid") in self._plots and told.get("data"):
                self._told["latency_ms"] = _longest(told["data"], packet, content, 16 + length)


def _longest(columns: list, packet: bytes, content: dict, start: int) -> float | None:
    """The longest of a plot's newest values; its first column are times."""
    places = []
    for size in content["binaryBufferLengths"]:
        start += -start % 8
        places.append((start, size))
        start += size
    newest = []
    for column in columns[1:]:
        offset, size = places[column["__binary_index"]]
        newest.append(memoryview(packet[offset : offset + size]).cast("d")[-1])
    known = [value for value in newest if math.isfinite(value)]
    return round(max(known), 2) if known else None


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
