"""PageFiles on their way to the page's folder: under a name of their own, within limits."""

import asyncio
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import pytest
from waiting import wait_for
from websockets.exceptions import ConnectionClosedError

from ros_visualise.ui.server.answers import BrowserQuery
from ros_visualise.ui.server.uploads import Uploads


def run_async(coroutine):
    """Run it on a thread of its own: browsers of other tests have an event loop on this one."""
    with ThreadPoolExecutor(1) as threads:
        threads.submit(asyncio.run, coroutine).result()


class Sender:
    """A browser that sends what it is told to."""

    def __init__(self):
        self._pieces = asyncio.Queue()

    def send(self, piece):
        self._pieces.put_nowait(piece)

    def go(self):
        self.send(ConnectionClosedError(None, None))

    async def receive(self):
        piece = await self._pieces.get()
        if isinstance(piece, Exception):
            raise piece
        return piece


class Taking:
    """Uploads that are under way at once, each by its sender."""

    def __init__(self, folder, **limits):
        self.folder, self.opened = folder, []
        self.uploads = Uploads(folder, self.opened.append, **limits)

    def begin(self, name, size, opens=""):
        sender = Sender()
        question = BrowserQuery(f"upload={name}&size={size}&open={opens}")
        return sender, asyncio.ensure_future(self.uploads.take(question, sender.receive))

    @property
    def names(self):
        return sorted(path.name for path in self.folder.iterdir())


@contextmanager
def taking(folder, **limits):
    made = Taking(folder, **limits)
    try:
        yield made
    finally:
        made.uploads.close()


async def until(check):
    await asyncio.to_thread(wait_for, check)


def test_a_file_has_its_name_when_it_is_whole(tmp_path):
    async def run():
        with taking(tmp_path) as here:
            sender, taken = here.begin("a.mp4", 6, "a.mp4")
            sender.send(b"123")
            await until(lambda: here.uploads.state == "a.mp4: 50 %")
            (part,) = here.names
            assert part.startswith("a.mp4.")
            assert part.endswith(".part")
            assert (tmp_path / part).read_bytes() == b"123"
            sender.send(b"456")
            await taken
            assert (here.names, here.uploads.state) == (["a.mp4"], "")
            assert (tmp_path / "a.mp4").read_bytes() == b"123456"
            assert here.opened == [tmp_path / "a.mp4"]

    run_async(run())


def test_two_of_one_name_do_not_meet(tmp_path, caplog):
    async def run():
        with taking(tmp_path) as here:
            first, one = here.begin("a.mp4", 2)
            await until(lambda: here.uploads.state)
            _, other = here.begin("a.mp4", 2)
            await other
            assert "a.mp4: already being uploaded" in caplog.text
            (tmp_path / "b.mp4").write_text("precious")
            _, third = here.begin("b.mp4", 2)
            await third
            assert "b.mp4: exists" in caplog.text
            first.send(b"12")
            await one
            assert (tmp_path / "a.mp4").read_bytes() == b"12"
            assert (tmp_path / "b.mp4").read_text() == "precious"
            assert here.names == ["a.mp4", "b.mp4"]

    run_async(run())


def test_what_got_the_name_meanwhile_stays(tmp_path, caplog):
    async def run():
        with taking(tmp_path) as here:
            sender, taken = here.begin("a.mp4", 2)
            await until(lambda: here.uploads.state)
            (tmp_path / "a.mp4").write_text("precious")
            sender.send(b"12")
            await taken
            assert here.names == ["a.mp4"]
            assert (tmp_path / "a.mp4").read_text() == "precious"
            assert "a.mp4: exists; choose another name; partial file removed" in caplog.text

    run_async(run())


@pytest.mark.parametrize("sent", [b"", "12", b"123"])
def test_what_was_not_announced_leaves_nothing(tmp_path, caplog, sent):
    async def run():
        with taking(tmp_path) as here:
            sender, taken = here.begin("a.mp4", 2)
            sender.send(sent)
            await taken
            assert here.names == []
            assert "size differs from the declared one; partial file removed" in caplog.text

    run_async(run())


def test_a_browser_that_goes_or_falls_silent_leaves_nothing(tmp_path, caplog):
    async def run():
        with taking(tmp_path, idle_s=0.05) as here:
            for goes in (True, False):
                sender, taken = here.begin("a.mp4", 9)
                sender.send(b"1234")
                if goes:
                    sender.go()
                await taken
                assert (here.names, here.uploads.state) == ([], "")
        assert (
            "a.mp4: connection closed before the upload was complete; partial file removed"
            in caplog.text
        )
        assert "a.mp4: no data for 0.05 s; partial file removed" in caplog.text

    run_async(run())


def test_all_together_have_a_limit_that_counts_what_is_there(tmp_path, caplog):
    async def run():
        with taking(tmp_path, total=10) as here:
            for name in ("a.mp4", "b.mp4"):
                sender, taken = here.begin(name, 4)
                sender.send(b"1234")
                await taken
            _, refused = here.begin("c.mp4", 3)
            await refused
            assert "c.mp4: uploads are limited to" in caplog.text
            (tmp_path / "a.mp4").unlink()
            first, one = here.begin("c.mp4", 3)
            await until(lambda: here.uploads.state)
            _, refused = here.begin("d.mp4", 4)  # what is announced counts
            await refused
            assert "d.mp4: uploads are limited to" in caplog.text
            first.send(b"123")
            await one
            assert here.names == ["b.mp4", "c.mp4"]

    run_async(run())


def test_a_few_come_at_once(tmp_path, caplog):
    async def run():
        with taking(tmp_path) as here:
            begun = [here.begin(f"{number}.mp4", 1) for number in range(5)]
            await begun[4][1]
            assert "4.mp4: 4 uploads are running; wait until one has ended" in caplog.text
            for sender, taken in begun[:4]:
                sender.send(b"x")
                await taken
            assert here.names == [f"{number}.mp4" for number in range(4)]

    run_async(run())


@pytest.mark.parametrize(
    "name",
    [
        *("gpm%E2%80%AE4pm.mp4", "a%E2%80%8Bb.mp4", "a%E2%81%A6b.mp4", "a%EF%BB%BFb.mp4"),
        *("a%C2%ADb.mp4", "%E3%85%A4.mp4", "a%E2%80%A8b.mp4", "a%EF%B8%8Fb.mp4", "a%1Bb.mp4"),
        *("%7F.mp4", "a%C2%85.mp4", "a%0A.mp4", "a%F3%A0%80%A0.mp4"),
    ],
)
def test_a_name_reads_as_it_is(tmp_path, caplog, name):
    async def run():
        with taking(tmp_path) as here:
            await here.begin(name, 1)[1]
            assert here.names == []
        assert "characters; choose another name" in caplog.text
        assert caplog.text.isascii()

    run_async(run())


@pytest.mark.parametrize("name", ["Bildschirm um 10.00.mov", "fährt.mp4", "飛行.mp4", "طيران.mp4"])
def test_names_of_all_languages_are_taken(tmp_path, name):
    async def run():
        with taking(tmp_path) as here:
            sender, taken = here.begin(name, 1)
            sender.send(b"x")
            await taken
            assert here.names == [name]

    run_async(run())
