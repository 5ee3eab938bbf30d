"""Images that come live: encoded once, the newest first, no faster than a browser takes them."""

import asyncio
import json
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

import cv2
import numpy as np
import pytest
from scene_messages import K, cloud, image, tf, transform
from scene_runtime import Told

from ros_visualise.data import CameraInfo, Header, Image, PointCloud, Transforms
from ros_visualise.ui.live import image_channel
from ros_visualise.ui.live.images import ImageHub
from ros_visualise.ui.live.space.hub import SpaceHub
from ros_visualise.ui.server.gate import Visit

DEPTH = np.array([[0.5, np.nan, 2.25], [0, 7, 1e-3]], np.float32)
DEEP = np.arange(12, dtype=np.uint16).reshape(2, 2, 3) * 5000


def picture(gray, stamp_ns=0):
    return Image(np.full((6, 8), gray, np.uint8), "mono8", Header(stamp_ns))


class Browser:
    """A browser that sends what it is told to, and keeps what comes."""

    def __init__(self, hub, is_viewer=False):
        self._sent = asyncio.Queue()
        self._sent.put_nowait({"type": "websocket.connect"})
        self.grays = []
        self.offers = []
        self.facts = []
        self.pixels = None
        self.answers = {}
        scope = {"state": {"visit": Visit(is_viewer, False, lambda size: None)}}
        self._serving = asyncio.ensure_future(hub.serve(scope, self._sent.get, self._take))

    def send(self, text="", **message):
        text = text or json.dumps(message)
        self._sent.put_nowait({"type": "websocket.receive", "text": text})

    def show(self, topic="/a", size=320, **options):
        self.send(show={"1": {"topic": topic, "size": size, **options}})

    def got(self):
        self.send(got="1")

    async def ask(self, what, *at, key="1"):
        number = len(self.answers)
        self.send(ask=number, key=key, what=what, at=at)
        await until(lambda: number in self.answers)
        return self.answers[number]

    async def leave(self):
        self._sent.put_nowait({"type": "websocket.disconnect"})
        await self._serving

    async def _take(self, message):
        if message.get("text"):
            self.offers = json.loads(message["text"])["topics"]
        if not message.get("bytes"):
            return
        data = message["bytes"]
        length = int.from_bytes(data[:4], "little")
        facts, body = json.loads(data[4 : 4 + length]), data[4 + length :]
        if "answer" in facts:
            self.answers[facts["answer"]] = facts, body
            return
        self.facts.append(facts)
        if body:
            self.pixels = cv2.imdecode(np.frombuffer(body, np.uint8), cv2.IMREAD_COLOR)
            self.grays.append(round(self.pixels.mean() / 10) * 10)


def run_async(work, **kinds):
    """Run it on a thread of its own: browsers of other tests have an event loop on this one."""

    async def begin():
        space = SpaceHub(asyncio.get_running_loop())
        hub = ImageHub(asyncio.get_running_loop(), lambda: space.shown)
        told = Told(**(kinds or {"a": Image, "b": Image}))
        for one in (space, hub):
            one.show(told)
        try:
            await work(hub, told)
        finally:
            hub.close()
            space.close()
            await asyncio.sleep(0)

    with ThreadPoolExecutor(1) as threads:
        threads.submit(asyncio.run, begin()).result(120)


async def until(check):
    async def wait():
        while not check():
            await asyncio.sleep(0.005)

    await asyncio.wait_for(wait(), 60)


async def settle():
    """Time in which what must not come would come."""
    await asyncio.sleep(0.15)


def test_a_browser_gets_the_newest_as_fast_as_it_takes_them():
    async def work(hub, told):
        told.say(a=picture(10))
        slow = Browser(hub)
        slow.show()
        await until(lambda: slow.grays == [10])  # the last one, though nothing plays
        told.say(a=picture(20))
        await until(lambda: slow.grays == [10, 20])
        for gray in (30, 40, 50):
            told.say(a=picture(gray))
        await settle()
        assert slow.grays == [10, 20]
        slow.got()
        await until(lambda: slow.grays == [10, 20, 50])
        await slow.leave()
        await until(lambda: told.asked["/a"] == 0)

    run_async(work)


def test_a_slow_browser_holds_up_no_other_and_an_image_is_encoded_once(monkeypatch):
    encoded = []
    imencode = cv2.imencode
    encode = lambda *given: encoded.append(1) or imencode(*given)  # noqa: E731
    monkeypatch.setattr(image_channel.cv2, "imencode", encode)

    async def work(hub, told):
        slow, quick = Browser(hub), Browser(hub)
        told.say(a=picture(10))
        for browser in (slow, quick):
            browser.show()
        await until(lambda: slow.grays == quick.grays == [10])
        for gray in (20, 30, 40):
            quick.got()
            told.say(a=picture(gray))
            await until(lambda gray=gray: quick.grays[-1] == gray)
        assert slow.grays == [10, 20]
        assert told.asked["/a"] == 1
        assert len(encoded) == 4
        await slow.leave()
        await quick.leave()

    run_async(work)


def test_images_are_as_large_as_the_largest_browser_shows_them():
    large = Image(np.zeros((600, 800), np.uint8), "mono8")

    async def work(hub, told):
        small, wide = Browser(hub), Browser(hub)
        told.say(a=large)
        small.show(size=100)
        await until(lambda: small.pixels is not None and small.pixels.shape == (75, 100, 3))
        wide.show(size=400)
        await until(lambda: wide.pixels is not None and wide.pixels.shape == (300, 400, 3))
        wide.show(size=9999)  # no larger than it is
        wide.got()
        await until(lambda: wide.pixels.shape == (600, 800, 3))
        assert (wide.facts[-1]["width"], wide.facts[-1]["height"]) == (800, 600)
        await small.leave()
        await wide.leave()

    run_async(work)


@pytest.mark.parametrize(
    "text",
    [
        *("", "x", "[]", "1", "null", "[" * 50_000, '{"show": 1}', '{"show": {"1": "x"}}'),
        *('{"show": {"1": {"topic": "/a", "size": true}}}', '{"got": {}}', '{"got": "1"}', "\x00"),
        *(
            '{"show": {"1": {"topic": 5, "size": 9}}}',
            '{"show": {"1": {"topic": "/no", "size": 9}}}',
        ),
        *('{"show": {"1": {"topic": "/a", "size": 1e99}}}', '{"show": {"1": {"size": 9}}}'),
        *(
            '{"show": {"1": {"topic": "/a", "size": 99999999}}}',
            '{"ask": 1, "key": [], "what": {}}',
        ),
        *('{"ask": 1, "key": "1", "what": "pick", "at": [0, 0]}', '{"ask": {}, "what": "png"}'),
        '{"show": {"1": {"topic": "/a", "size": 9, "cloud": "/b"}}}',
    ],
)
def test_nonsense_shows_nothing_and_ends_nothing(text):
    async def work(hub, told):
        browser = Browser(hub)
        browser.send(text)
        told.say(a=picture(10))
        await settle()
        assert browser.grays == []
        assert told.asked["/a"] == 0
        browser.show()
        await until(lambda: browser.grays == [10])
        await browser.leave()

    run_async(work)


@pytest.mark.parametrize(
    ("what", "at"),
    [
        *(
            ("part", at)
            for at in (["x"], [1], [1e300] * 4, [float("nan")] * 4, [0] * 9, {}, [True] * 4)
        ),
        *(("line", at) for at in ([], [1, 2, 3], [None] * 4)),
        *((what, []) for what in ("", "no", "__class__", [1], {})),
    ],
)
def test_senseless_questions_are_answered_with_the_reason(what, at):
    async def work(hub, told):
        told.say(a=picture(10))
        browser = Browser(hub)
        browser.show()
        await until(lambda: browser.grays)
        browser.send(ask=99, key="1", what=what, at=at)
        await until(lambda: 99 in browser.answers)
        assert "problem" in browser.answers[99][0]
        assert (await browser.ask("part", 1, 1, 1, 1))[1] == bytes([10])
        await browser.leave()

    run_async(work)


def test_many_views_of_a_crowd_are_bounded(monkeypatch):
    monkeypatch.setattr("ros_visualise.ui.live.images._MOST_CHANNELS", 3)

    async def work(hub, told):
        told.say(a=picture(10), b=picture(20))
        crowd = [Browser(hub, is_viewer=True) for _ in range(4)]
        for number, browser in enumerate(crowd):
            stretch, boxes = number % 2 == 0, number > 1
            views = {
                t: {"topic": t, "size": 9, "stretch": stretch, "boxes": boxes} for t in ("/a", "/b")
            }
            browser.send(show=views)
        await until(lambda: sum(len(one.grays) for one in crowd) >= 3)
        await settle()
        assert told.asked["/a"] + told.asked["/b"] == 3
        for browser in crowd:
            await browser.leave()
        await until(lambda: told.asked["/a"] + told.asked["/b"] == 0)

    run_async(work)


def test_two_images_are_subtracted_that_have_one_stamp():
    async def work(hub, told):
        browser = Browser(hub)
        browser.show(minus="/b")
        await until(lambda: told.asked["/b"] == 1)
        told.say(a=picture(100, 1))
        told.say(a=picture(200, 2))
        told.say(b=picture(70, 1))
        await until(lambda: browser.grays == [30])
        assert browser.facts[0]["apart"] == 0
        assert (await browser.ask("part", 0, 0, 1, 1))[1] == bytes([30])
        await browser.leave()

    run_async(work)


@pytest.mark.parametrize(
    ("one", "other", "values"),
    [
        (("rgb8", [10, 20, 30]), ("bgr8", [33, 20, 7]), [3, 0, 3]),
        (("rgb8", [10, 20, 30]), ("mono8", [11]), [19, 9, 1]),  # of what is shown, as BGR
        (("mono16", [60000]), ("mono16", [59000]), [1000]),
        (("16UC1", [1500]), ("16UC1", [1000]), [500]),
        (("16UC1", [0]), ("16UC1", [1000]), [0]),  # no measurement
        (("16UC1", [1500]), ("mono8", [7]), "cannot be subtracted"),
    ],
)
def test_a_difference_is_of_the_values_themselves(one, other, values):
    def made(encoding, numbers):
        dtype = np.uint16 if "16" in encoding else np.uint8
        pixels = np.array(numbers, dtype).reshape((1, 1, 3) if len(numbers) == 3 else (1, 1))
        return Image(pixels, encoding, Header(5))

    async def work(hub, told):
        browser = Browser(hub)
        browser.show(minus="/b")
        told.say(a=made(*one), b=made(*other))
        await until(lambda: browser.facts)
        if isinstance(values, str):
            assert values in browser.facts[0]["problem"]
        else:
            facts, body = await browser.ask("part", 0, 0, 1, 1)
            assert np.frombuffer(body, facts["dtype"]).tolist() == values
        await browser.leave()

    run_async(work)


@pytest.mark.parametrize(
    ("pixels", "encoding"), [(DEEP, "rgb16"), (DEPTH, "32FC1"), (DEEP[..., 0].copy(), "16UC1")]
)
def test_values_come_as_they_are(pixels, encoding):
    async def work(hub, told):
        told.say(a=Image(pixels, encoding, Header(2**62 + 1, "camera")))
        browser = Browser(hub)
        browser.show()
        await until(lambda: browser.facts)
        shown = browser.facts[0]
        assert (shown["encoding"], shown["stamp"]) == (encoding, str(2**62 + 1))
        facts, body = await browser.ask("part", -5, -5, 99, 99)
        found = np.frombuffer(body, facts["dtype"]).reshape(pixels.shape)
        np.testing.assert_array_equal(found, pixels)
        assert facts["metres"] == {"32FC1": 1.0, "16UC1": 0.001}.get(encoding, 0)
        facts, body = await browser.ask("part", 1, 1, 1, 1)
        np.testing.assert_array_equal(np.frombuffer(body, facts["dtype"]), np.ravel(pixels[1, 1]))
        facts, body = await browser.ask("line", 0, 0, 1.9, 0)
        along = np.frombuffer(body, facts["dtype"])
        np.testing.assert_array_equal(along, np.ravel(pixels[0, :2]))
        facts, _ = await browser.ask("histogram")
        assert sum(map(sum, facts["counts"])) == (np.isfinite(pixels) & (pixels != 0)).sum() or (
            encoding == "rgb16"
        )
        await browser.leave()

    run_async(work)


def test_16_bits_are_saved_as_they_are():
    async def work(hub, told):
        told.say(a=Image(DEEP, "rgb16", Header(7)))
        browser = Browser(hub)
        browser.show()
        await until(lambda: browser.facts)
        facts, body = await browser.ask("png")
        read = cv2.imdecode(np.frombuffer(body, np.uint8), cv2.IMREAD_UNCHANGED)
        np.testing.assert_array_equal(read[..., ::-1], DEEP)
        assert facts["stamp"] == "7"
        await browser.leave()

    run_async(work)


def test_values_are_those_of_the_image_that_is_shown_though_all_have_stamp_0():
    async def work(hub, told):
        browser = Browser(hub)
        browser.show()
        for gray in (10, 20, 30):
            told.say(a=picture(gray))
            await until(lambda gray=gray: browser.grays[-1:] == [gray])
            browser.got()
            assert (await browser.ask("part", 0, 0, 1, 1))[1] == bytes([gray])
        await browser.leave()

    run_async(work)


def test_an_image_that_is_kept_stays_with_its_values():
    async def work(hub, told):
        told.say(a=picture(10))
        browser = Browser(hub)
        browser.show()
        await until(lambda: browser.grays == [10])
        browser.show(held=True)
        await settle()
        told.say(a=picture(20))
        await settle()
        assert (await browser.ask("part", 0, 0, 1, 1))[1] == bytes([10])
        browser.show()
        await until(lambda: browser.grays == [10, 20])
        await browser.leave()

    run_async(work)


def test_contrast_is_stretched_on_request():
    dark = np.tile(np.arange(10, 20, dtype=np.uint8), (50, 5))

    async def work(hub, told):
        told.say(a=Image(dark, "mono8"))
        browser = Browser(hub)
        browser.show()
        await until(lambda: browser.pixels is not None)
        assert browser.pixels.max() < 25
        browser.show(stretch=True)
        await until(lambda: browser.pixels.max() > 240)
        assert browser.pixels.min() < 15
        assert (await browser.ask("part", 0, 0, 1, 1))[1] == bytes([10])
        await browser.leave()

    run_async(work)


def test_points_of_a_cloud_are_drawn_where_the_camera_sees_them():
    spot = [[1.025, -0.475, 5.0]]

    async def work(hub, told):
        at = transform("base", "camera", [1, 0, 0]), transform("base", "lidar", [1, 0, 0])
        told.say(tf_static=tf(*at), info=CameraInfo(120, 160, K, header=Header(0, "camera")))
        told.say(points=cloud(spot, frame="lidar"), image=image(calibrated=False))
        browser = Browser(hub)
        browser.show("/image", size=160)
        await until(lambda: browser.pixels is not None)
        assert browser.offers[0] == {
            "topic": "/image",
            "clouds": ["/points"],
            "boxes": False,
            "picks": False,
        }
        plain = browser.pixels
        browser.show("/image", size=160, cloud="/points")
        await until(lambda: browser.pixels is not plain)
        moved = np.argwhere(np.abs(browser.pixels.astype(int) - plain).max(axis=2) > 60)
        assert np.abs(moved.mean(axis=0) - [50, 100]).max() < 2
        assert told.asked["/points"] == 1
        browser.show("/image", size=160)
        await until(lambda: told.asked["/points"] == 0)
        await browser.leave()

    kinds = {"points": PointCloud, "tf_static": Transforms, "info": CameraInfo}
    run_async(work, image=Image, **kinds)


def test_what_ends_is_forgotten_and_another_graph_goes_on():
    async def work(hub, told):
        told.say(a=picture(10))
        browser = Browser(hub)
        browser.show()
        await until(lambda: browser.grays == [10])
        other = Told(a=Image)
        hub.show(None)
        await until(lambda: told.asked["/a"] == 0)
        assert [one["topic"] for one in browser.offers] == [
            "/a",
            "/b",
        ]  # a page that ends does not say that they are missing
        told.say(a=picture(50))
        hub.show(other)
        await until(lambda: other.asked["/a"] == 1)
        other.say(a=picture(20))
        await until(lambda: browser.grays == [10, 20])
        with suppress(asyncio.CancelledError):
            await browser.leave()

    run_async(work)
