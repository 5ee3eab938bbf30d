"""Images that come live: encoded once, the newest first, no faster than a browser takes them."""

import asyncio
import json
import threading
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
import pytest

from ros_visualise.ui.live import images
from ros_visualise.ui.live.images import ImageHub, packet


def picture(gray):
    return np.full((6, 8, 3), gray, np.uint8)


class Browser:
    """A browser that sends what it is told to, and keeps what comes."""

    def __init__(self, hub):
        self._sent = asyncio.Queue()
        self._sent.put_nowait({"type": "websocket.connect"})
        self.grays = []
        self._serving = asyncio.ensure_future(hub.serve({}, self._sent.get, self._take))

    def send(self, message):
        text = message if isinstance(message, str) else json.dumps(message)
        self._sent.put_nowait({"type": "websocket.receive", "text": text})

    async def leave(self):
        self._sent.put_nowait({"type": "websocket.disconnect"})
        await self._serving

    async def _take(self, message):
        if message["type"] == "websocket.send":
            jpeg = message["bytes"].removeprefix(packet("a", b""))
            pixels = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
            self.grays.append(round(pixels.mean() / 10) * 10)


def run_async(work):
    """Run it on a thread of its own: browsers of other tests have an event loop on this one."""

    async def begin():
        hub = ImageHub(asyncio.get_running_loop())
        await work(hub, hub.channel("a"))

    with ThreadPoolExecutor(1) as threads:
        threads.submit(asyncio.run, begin()).result(60)


async def settle():
    for _ in range(20):
        await asyncio.sleep(0)


async def show(channel, *grays):
    for gray in grays:
        channel.show(picture(gray))
        await settle()


def test_a_browser_gets_the_newest_as_fast_as_it_takes_them():
    async def work(hub, channel):
        await show(channel, 10)
        slow = Browser(hub)
        slow.send({"show": {"a": 320}})
        await settle()
        assert slow.grays == [10]  # the last one, though nothing plays
        await show(channel, 20, 30, 40, 50)
        assert (slow.grays, channel.is_ready) == ([10, 20], False)
        slow.send({"got": "a"})
        await settle()
        assert slow.grays == [10, 20, 50]
        slow.send({"got": "a"})
        await settle()
        assert channel.is_ready
        await slow.leave()
        assert (channel.size, channel.is_ready) == (0, False)

    run_async(work)


def test_a_slow_browser_holds_up_no_other_and_an_image_is_encoded_once(monkeypatch):
    encoded = []
    imencode = cv2.imencode
    monkeypatch.setattr(images.cv2, "imencode", lambda *a: encoded.append(1) or imencode(*a))

    async def work(hub, channel):
        slow, quick = Browser(hub), Browser(hub)
        slow.send({"show": {"a": 100}})
        quick.send({"show": {"a": 700}})
        await settle()
        assert channel.size == 700
        for gray in (10, 20, 30, 40):
            await show(channel, gray)
            quick.send({"got": "a"})
            await settle()
        assert (slow.grays, quick.grays, len(encoded)) == ([10, 20], [10, 20, 30, 40], 4)
        quick.send({"show": {}})
        await settle()
        assert channel.size == 100
        await slow.leave()
        await quick.leave()

    run_async(work)


@pytest.mark.parametrize(
    "text",
    [
        *("", "x", "[]", "1", "null", "[" * 50_000, '{"show": 1}', '{"show": {"a": "x"}}'),
        *('{"show": {"a": -1}}', '{"show": {"a": true}}', '{"show": {"a": 1e99}}', '{"got": {}}'),
        *('{"show": {"b": 5}}', '{"got": "a"}', '{"got": "b"}', '{"show": {"a": 99999}}', "\x00"),
    ],
)
def test_nonsense_shows_nothing_and_ends_nothing(text):
    async def work(hub, channel):
        browser = Browser(hub)
        browser.send(text)
        await show(channel, 10)
        assert (browser.grays, channel.size) == ([], 0)
        browser.send({"show": {"a": 5}})
        await settle()
        assert browser.grays == [10]
        await browser.leave()

    run_async(work)


def test_any_thread_shows_images():
    async def work(hub, channel):
        browser = Browser(hub)
        browser.send({"show": {"a": 5}})
        thread = threading.Thread(target=channel.show, args=[picture(60)])
        thread.start()
        while not browser.grays:
            await asyncio.sleep(0.01)
        thread.join()
        assert browser.grays == [60]
        await browser.leave()

    run_async(work)
