"""The page's server: its address, its silence, and clients that misbehave."""

import gc
import re
import socket
import subprocess
import sys
from contextlib import ExitStack, suppress
from threading import Thread

import pytest
from page_client import TOKEN, Client, ImageClient, addresses
from waiting import wait_for
from websockets.sync.client import connect

from ros_visualise.core.errors import OpenError
from ros_visualise.ui import ViewOptions
from ros_visualise.ui.page import Page
from ros_visualise.ui.page.server import PageServer
from ros_visualise.ui.server.access import access_rules

PROBES = [b"", b"\x16\x03\x01\x02garbage\xff\xfe\r\n\r\n", b"HEAD / HTTP/1.1\r\n\r\n"]
PROBES += [
    b"GET /no/such%2e%2e/page HTTP/1.1\r\n\r\n",
    b"GET / HTTP/1.1\r\nUpgrade: websocket\r\n\r\n",
]
DEAF = """
import socket, sys
from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.playback import Playback
from ros_visualise.ui import ViewOptions
from ros_visualise.ui.page import Page
page = Page(ViewOptions(port=int(sys.argv[1])))
runtime = LocalRuntime(image_pipeline("landscape"), Playback(hold=True))
runtime.start()
page.open(runtime)
print("open", page.url, flush=True)
sys.stdin.readline()
page.close()
runtime.stop()
"""


def knock(port):
    """Connect again and again, until nobody answers."""
    connected = []
    with suppress(OSError), ExitStack() as stack:
        while len(connected) < 500:
            connected.append(stack.enter_context(socket.create_connection(("127.0.0.1", port))))


@pytest.fixture
def client(page, port):
    connected = Client(port)
    connected.read_until(lambda: len(connected.images) >= 3)
    yield connected
    connected.close()


def test_listens_at_its_address_and_no_other(port):
    page = Page(ViewOptions(port=port))
    assert page.url == f"http://127.0.0.1:{port}/{TOKEN}"
    socket.create_connection(("127.0.0.1", port)).close()
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.2", port))
    page.close()
    page.close()
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", port))


def test_port_in_use_names_it_and_another():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(
            OpenError, match=f"port {port} on 127.0.0.1 is already in use.*--port {port + 1}"
        ):
            Page(ViewOptions(port=port))


@pytest.mark.parametrize("host", ["192.0.2.1", "no.such.host.invalid"])
def test_foreign_address_is_refused_by_name(host, port):
    with pytest.raises(OpenError, match=f"--host {re.escape(host)}: not an address of this"):
        Page(ViewOptions(host, port))


def test_probes_and_broken_connections_leave_no_line(port):
    code = [sys.executable, "-c", DEAF, str(port)]
    pipe = subprocess.PIPE
    with subprocess.Popen(code, stdin=pipe, stdout=pipe, stderr=pipe, text=True) as served:
        assert served.stdout.readline() == f"open http://127.0.0.1:{port}/{TOKEN}\n"
        for probe in PROBES:
            with socket.create_connection(("127.0.0.1", port)) as connection:
                connection.sendall(probe)
        client = Client(port)
        client.read_until(lambda: len(client.images) >= 3)
        client.vanish()  # gone without a word
        deaf = Client(port)
        out, err = served.communicate("\n", timeout=20)
        deaf.vanish()
    assert (served.returncode, out, err) == (0, "", addresses(port))


def test_who_knocks_as_the_server_ends_is_let_go(port):
    for _ in range(15):
        server = PageServer("127.0.0.1", port, "test", access_rules("127.0.0.1"))
        knocking = Thread(target=knock, args=(port,))
        knocking.start()
        server.close()
        knocking.join()
        server.host.serving.result(5)
    gc.collect()  # what was forgotten would warn here, which is an error


def test_a_client_that_reads_nothing_harms_nobody(client, runtime):
    deaf = Client(client.socket.remote_address[1])
    runtime.playback.play()
    before = len(client.images)
    client.read_until(lambda: len(client.images) >= before + 100)
    assert runtime.report().nodes["edge_detector"].processed > 20
    deaf.vanish()


def test_topics_are_followed_only_while_somebody_looks(page, port, runtime, monkeypatch):
    followed = []
    subscribe = runtime.subscribe

    def counted(topic, depth=1):
        subscription = subscribe(topic, depth)
        close = subscription.close
        subscription.close = lambda: (followed.remove(topic), close())
        followed.append(topic)
        return subscription

    monkeypatch.setattr(runtime, "subscribe", counted)
    clients = [ImageClient(port), ImageClient(port)]
    for client in clients:
        client.show("/processed_image", "/edges")
        client.read_until(lambda client=client: len(client.images) >= 2)
    assert sorted(followed) == ["/edges", "/processed_image"]  # once for both
    for client in clients:
        client.show("/edges", "/no/such")
    wait_for(lambda: followed == ["/edges"])
    for client in clients:
        client.socket.close()
    wait_for(lambda: not followed)


def test_playing_waits_for_the_panels_of_a_browser(page, port):
    assert page.awaited
    with connect(f"ws://127.0.0.1:{port}/{TOKEN}/live/nodes"):
        assert page.awaited  # its panels are not there yet
    client = Client(port)
    client.read_until(lambda: not page.awaited)
    client.close()
    wait_for(lambda: page.awaited)
    with connect(f"ws://127.0.0.1:{port}/{TOKEN}/live/offered") as offered:
        offered.send('{"seen": true}')
        wait_for(lambda: not page.awaited)
