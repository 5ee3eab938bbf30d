"""Browsers that take answers slowly, or not at all, or ask for very many."""

import gc
import math
import socket
import threading
import time
from contextlib import ExitStack, closing, suppress
from functools import partial

import nicegui
import pytest
from page_client import TOKEN, VIEW_TOKEN, Client, get
from waiting import wait_for
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

import ros_visualise.ui.page
import ros_visualise.ui.server.door
from ros_visualise.ui import ViewOptions
from ros_visualise.ui.file_chooser import FileChooser
from ros_visualise.ui.live.images import ImageHub
from ros_visualise.ui.page import Page
from ros_visualise.ui.server.host import page_loop
from ros_visualise.ui.server.uploads import UploadedFile
from ros_visualise.ui.shell.application import NICEGUI

OURS = {"X-Ros-Visualise": "1"}
TICKS = "/?ask=ticks"
LARGE = f"{NICEGUI}/{nicegui.__version__}/static/quasar.umd.js"
LARGE_SIZE = 1_000_000
_BUFFER = 4096


class Reader:
    """Asks for something and takes it as slowly as it is told to."""

    def __init__(self, port, path, token=TOKEN):
        self.socket = socket.socket()
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
        self.socket.connect(("127.0.0.1", port))
        self.socket.settimeout(60)
        host = f"Host: 127.0.0.1:{port}\r\nX-Ros-Visualise: 1\r\n"
        self.socket.sendall(f"GET /{token}{path} HTTP/1.1\r\n{host}\r\n".encode())

    def status(self):
        return int(self.socket.recv(12).split()[1])

    def take(self, bytes_per_s=math.inf):
        """So many bytes until the end, as slowly as this."""
        count, begun_s = 0, time.monotonic()
        try:
            while piece := self.socket.recv(_BUFFER):
                count += len(piece)
                time.sleep(max(begun_s + count / bytes_per_s - time.monotonic(), 0))
        except ConnectionResetError:
            pass
        return count


@pytest.fixture
def shown(page, runtime):
    """The page, when there are images to ask for."""
    wait_for(lambda: runtime.report().topics.get("/edges"), "the first image")
    return page


def stall_after(monkeypatch, stall_s):
    monkeypatch.setattr(ros_visualise.ui.server.door, "STALL_S", stall_s)


def test_who_takes_an_answer_slowly_gets_all_of_it(shown, port, monkeypatch):
    stall_after(monkeypatch, 1.5)
    reader = Reader(port, LARGE)
    with closing(reader.socket):
        begun_s = time.monotonic()
        count = reader.take(bytes_per_s=LARGE_SIZE / 2)
        assert count > LARGE_SIZE
        assert time.monotonic() - begun_s > 3, "that was not slow"


def test_who_takes_nothing_is_let_go(shown, port, monkeypatch, caplog):
    stall_after(monkeypatch, 0.2)
    reader = Reader(port, LARGE)
    with closing(reader.socket):
        wait_for(lambda: "a browser accepted no data for 0.2 s" in caplog.text, "the end")
        assert 0 < reader.take() < LARGE_SIZE
    wait_for(lambda: get(port, TICKS, **OURS)[0] == 200, "an answer")


def test_sixty_who_take_nothing_hold_a_few_answers_and_nobody_up(shown, port):
    with ExitStack() as stack:
        readers = [Reader(port, LARGE, VIEW_TOKEN) for _ in range(60)]
        for reader in readers:
            stack.enter_context(closing(reader.socket))
        statuses = [reader.status() for reader in readers]
        assert statuses.count(503) >= 60 - 16
        assert statuses.count(200) + statuses.count(503) == 60
        for path in ("/?ask=graph", TICKS, "/"):
            assert get(port, path, **OURS)[0] == 200
        assert get(port, "/?ask=graph", VIEW_TOKEN, **OURS)[0] == 503
    again = partial(get, port, "/?ask=graph", VIEW_TOKEN, **OURS)
    wait_for(lambda: again()[0] == 200, "room for answers")


def test_who_waits_for_an_answer_holds_no_other_question_up(shown, port, monkeypatch):
    held = threading.Event()
    monkeypatch.setattr(ros_visualise.ui.page, "ticks", lambda *_: held.wait(60))
    try:
        with ExitStack() as stack:
            for _ in range(60):
                stack.enter_context(closing(Reader(port, TICKS, VIEW_TOKEN).socket))
            assert get(port, "/?ask=graph", **OURS)[0] == 200
    finally:
        held.set()


def test_the_end_waits_for_nobody(port, runtime):
    page = Page(ViewOptions(port=port))
    page.open(runtime)
    wait_for(lambda: get(port, TICKS, **OURS)[0] == 200, "the first image")
    with ExitStack() as stack:
        for path in [LARGE] * 5 + ["/"] * 5:
            stack.enter_context(closing(Reader(port, path).socket))
        for _ in range(5):  # who ask for nothing
            stack.enter_context(socket.create_connection(("127.0.0.1", port)))
        get(port, TICKS, **OURS)
        page.close()
        page._server.host.serving.result(5)
    gc.collect()  # what was forgotten would warn here, which is an error


def test_slow_uploads_hold_no_question_up_and_questions_no_upload(
    port, runtime, tmp_path, monkeypatch
):
    page = Page(
        ViewOptions(port=port, record_dir=tmp_path, chooser=FileChooser(tmp_path, tmp_path))
    )
    page.open(runtime)
    held, write = threading.Event(), UploadedFile.write

    def slow(incoming, data):
        assert held.wait(60)
        write(incoming, data)

    monkeypatch.setattr(UploadedFile, "write", slow)
    try:
        with ExitStack() as stack:
            for number in range(4):
                address = f"ws://127.0.0.1:{port}/{TOKEN}/?upload={number}.mp4&size=1"
                stack.enter_context(connect(address)).send(b"x")
            wait_for(lambda: len(list(tmp_path.glob("*.part"))) == 4, "the uploads")
            wait_for(lambda: get(port, TICKS, **OURS)[0] == 200, "an answer")
            for _ in range(60):
                stack.enter_context(closing(Reader(port, TICKS, VIEW_TOKEN).socket))
            held.set()
            names = [f"{number}.mp4" for number in range(4)]
            wait_for(lambda: sorted(p.name for p in tmp_path.iterdir()) == names, "the files")
    finally:
        held.set()
        page.close()


def test_who_connects_and_asks_for_nothing_keeps_nobody_out(shown, port):
    with ExitStack() as stack:
        silent = [socket.create_connection(("127.0.0.1", port)) for _ in range(300)]
        for one in silent:
            stack.enter_context(one)
            one.settimeout(60)
        assert get(port, "/?ask=graph", **OURS)[0] == 200
        with suppress(ConnectionResetError):
            assert all(one.recv(1) == b"" for one in silent[:190])  # they were ended


def test_of_many_who_connect_at_once_few_stay(shown, port, monkeypatch):
    monkeypatch.setattr(ros_visualise.ui.server.door, "REQUEST_S", 600.0)
    with ExitStack() as held:
        silent = []
        for _ in range(3):
            come_together(shown, partial(connect_to, port, held, silent, 90))
            assert get(port, "/?ask=graph", **OURS)[0] == 200  # all of them were let in
        for one in silent[:170]:
            assert one.recv(1) == b""


def come_together(shown, come):
    """While they come, the server accepts nobody."""
    is_held, may_go_on = threading.Event(), threading.Event()

    def hold():
        is_held.set()
        may_go_on.wait(60)

    page_loop().call_soon_threadsafe(hold)
    is_held.wait(60)
    come()
    may_go_on.set()


def connect_to(port, held, silent, count):
    for _ in range(count):
        one = held.enter_context(closing(socket.create_connection(("127.0.0.1", port))))
        one.settimeout(20)
        silent.append(one)


def test_a_crowd_that_looks_leaves_room_for_its_host(shown, port):
    with ExitStack() as stack:
        address = f"ws://127.0.0.1:{port}/{VIEW_TOKEN}{ImageHub.path}"
        for _ in range(150):
            stack.enter_context(connect(address))
        with pytest.raises(InvalidStatus) as refused:
            connect(address)
        assert refused.value.response.status_code == 503
        host = Client(port)
        stack.enter_context(closing(host))
        host.read_until(lambda: len(host.images) >= 3)
