"""What a page lets in: requests and messages of clients that mean no good."""

import json
import math
import os
import random
import subprocess
import sys
import threading
from contextlib import closing, suppress
from http.client import HTTPConnection
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest
from page_client import TOKEN, VIEW_TOKEN, Client, addresses, get
from ports import free_port
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from ros_visualise.core import supervision
from ros_visualise.ui import ViewOptions
from ros_visualise.ui.page import Page

EVIL = """<!doctype html><body><iframe src="http://127.0.0.1:{port}/{token}"></iframe><script>
window.told = new Promise(tell => {{
    const socket = new WebSocket("ws://127.0.0.1:{port}/{token}/live/nodes");
    socket.onopen = () => tell("open");
    socket.onclose = () => tell("closed");
}});
</script>"""
SERVED = """
import sys
from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.playback import Playback
from ros_visualise.core import supervision
from ros_visualise.ui import ViewOptions
from ros_visualise.ui.page import Page
page = Page(ViewOptions(port=int(sys.argv[1])))
runtime = LocalRuntime(image_pipeline("landscape"), Playback(hold=True))
runtime.start()
page.open(runtime)
print("open", flush=True)
sys.stdin.readline()
page.close()
runtime.stop()
"""
LIVE = [
    *("/live/nodes", "/live/robot", "/live/files", "/live/images", "/live/clock", "/live/topics"),
    *("/live/offered", "/live/space", "/live/plots", "/live/messages", "/live/monitor"),
    "/foxglove",
]
RIGHT = [
    {"do": "set", "values": {"filters": {"threshold": 90}}, "number": 1},
    {"do": "act", "node": "filters", "action": "reset"},
    {"do": "restore", "values": {"filters/threshold": "90"}, "number": 2},
    {"do": "read", "topics": ["/edges"]},
    {"do": "hold", "press": "a", "names": ["forward"], "speed": 1, "turn": 0.5},
    {"do": "open", "name": "nothing.mp4"},
    {"do": "save", "what": "layout", "name": "../x.yaml", "layout": "{}"},
    {"show": {"a": {"topic": "/edges", "size": 100}}},
    {"ask": 1, "key": "a", "what": "pixels", "at": [0, 0]},
    {"seek": 0.5},
    {"mark": [0.5, "here"]},
    {"pick": {"ray": [0, 0, 0, 0, 0, 1], "id": 1}},
    {"set": {"frame": "map"}},
    {"number": 1, "views": [{"curve": "/odom:x"}], "from": 0, "to": 1, "columns": 80},
    {"csv": ["/odom:x"], "from": 0, "to": 1},
    {"topic": "/edges", "last": 5},
    {"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 1}]},
]
WILD = [
    *(None, True, False, 0, -1, 1, 256, 2**53 + 1, 2**64 - 1, -(2**63), 1e20, -1e20, 1e308),
    *(math.nan, math.inf, -math.inf, 0.5, "", "x", "x" * 5000, "\x00", "\u202e", "\ud800"),
    *([], [1, 2], {}, {"value": 1}, [[[]]], "../../etc/passwd", "<script>", "❚❚ pause"),
]


@pytest.fixture
def client(page, port):
    connected = Client(port)
    with closing(connected):
        connected.read_until(lambda: len(connected.images) >= 3)
        yield connected


@pytest.fixture(scope="module")
def served():
    """A page in a process of its own, and its port; it has to end without a word."""
    pipe, port = subprocess.PIPE, free_port()
    code = [sys.executable, "-c", SERVED, str(port)]
    own = {"ROS_VISUALISE_TOKEN": TOKEN, "ROS_VISUALISE_VIEW_TOKEN": VIEW_TOKEN}
    with subprocess.Popen(
        code, stdin=pipe, stdout=pipe, stderr=pipe, text=True, env=os.environ | own
    ) as process:
        assert process.stdout.readline() == "open\n"
        yield process, port
        out, err = process.communicate("\n", timeout=30)
    assert (process.returncode, out, err) == (0, "", addresses(port))


def all_there(port):
    """Whether somebody who comes now sees it all."""
    late = Client(port)
    with closing(late):
        late.read_until(lambda: len(late.images) >= 3)
    return True


@pytest.mark.parametrize("path", ["/", "/index.html", "/no/such", "/%2e%2e/x"])
def test_a_foreign_name_or_site_gets_nothing_on_any_path(page, port, path):
    own = f"127.0.0.1:{port}"
    for headers in (
        {"Host": f"evil.example:{port}"},
        {"Host": own, "Origin": "http://evil.example"},
        {"Host": own, "Origin": "null"},
        {"Host": own, "Origin": f"http://localhost:{port + 1}"},
    ):
        status, _, text = get(port, path, **headers)
        assert status == 403
        assert "--allow-origin" in text
        upgrade = {"Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13"}
        key = {"Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA=="}
        assert get(port, path, **headers, **upgrade, **key)[0] == 403


@pytest.mark.parametrize(
    "path",
    [
        "/_nicegui_ws/socket.io/?EIO=4&transport=websocket",
        *LIVE,
        "/?upload=a.mp4&size=1",
    ],
)
def test_every_websocket_is_behind_the_gate(page, port, path):
    for token, origin in (("", None), ("x", None), (TOKEN, "http://evil.example")):
        with pytest.raises(InvalidStatus) as refused:
            connect(f"ws://127.0.0.1:{port}/{token}{path}", origin=origin)
        assert refused.value.response.status_code == 403


def test_only_reading_methods_are_answered(page, port):
    for method in ("POST", "PUT", "DELETE", "OPTIONS", "PATCH"):
        with closing(HTTPConnection("127.0.0.1", port, timeout=60)) as asked:
            asked.request(method, f"/{TOKEN}/", b"x")
            assert asked.getresponse().status == 405


def test_a_long_path_is_no_fault_of_the_server(page, port):
    assert get(port, "/" + "a" * 6000)[0] == 414
    assert get(port, "/" + "a" * 260)[0] == 414
    assert get(port, "/" + "a" * 200)[0] == 404
    assert get(port, "/?" + "a" * 2000)[0] == 200


def test_own_names_are_served_and_nobody_else_may_frame_them(page, port):
    for host in (f"127.0.0.1:{port}", f"localhost:{port}", "localhost:9000", f"[::1]:{port}"):
        status, headers, text = get(port, Host=host, Origin=f"http://{host}")
        assert status == 200
        assert "<html" in text
        assert headers["Content-Security-Policy"] == "frame-ancestors 'self'"
        assert headers["Cross-Origin-Resource-Policy"] == "same-origin"
    assert all_there(port)


def test_refusals_are_said_once(page, port, caplog):
    for _ in range(3):
        with pytest.raises(InvalidStatus):
            Client(port, origin="http://evil.example")
    for number in range(20):
        get(port, Host=f"evil{number}.example")
    said = [record.getMessage() for record in caplog.records]
    assert len(said) == 5
    assert said[0].startswith(
        "page: request rejected: request from the web site 'http://evil.example'"
    )


def test_a_proxy_comes_in_by_its_origin(port, runtime):
    page = Page(ViewOptions(port=port, origins=["https://robot.example.org"]))
    page.open(runtime)
    client = Client(port, origin="https://robot.example.org")
    with closing(client):
        client.read_until(lambda: len(client.images) >= 3)
    _, headers, _ = get(port)
    assert headers["Content-Security-Policy"].endswith("'self' https://robot.example.org")
    page.close()


@pytest.mark.parametrize("path", ["/", "/index.html", "/?layout=x", "/?ask=graph", "/no/such"])
def test_without_the_token_nothing_is_answered(page, port, path):
    upgrade = {"Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13"}
    key = {"Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==", "X-Ros-Visualise": "1"}
    for token in ("", TOKEN[:-1], f"{TOKEN}x", VIEW_TOKEN[:-1], "%00", "a" * 5000):
        status, headers, text = get(port, path, token, **key)
        assert (status, "token missing" in text) == (403, True)
        assert headers["Referrer-Policy"] == "no-referrer"
        assert get(port, path, token, **upgrade, **key)[0] == 403


def test_without_a_token_where_that_is_asked_for(port, runtime, caplog, capfd):
    page = Page(ViewOptions(port=port, token=False))
    page.open(runtime)
    assert (page.url, page.view_url) == (f"http://127.0.0.1:{port}", "")
    assert capfd.readouterr().err == f"open http://127.0.0.1:{port} (Ctrl-C stops)\n"
    assert get(port, "/", "")[0] == 200
    client = Client(port, "")
    with closing(client):
        client.read_until(lambda: len(client.images) >= 3)
    page.close()
    assert not caplog.records
    Page(ViewOptions("0.0.0.0", port, token=False)).close()
    assert "no token: anyone who can reach 0.0.0.0 can use the page" in caplog.text


def test_the_address_is_printed_and_never_logged(port, runtime, caplog, capfd):
    caplog.set_level("DEBUG")
    page = Page(ViewOptions(port=port))
    page.open(runtime)
    assert (page.url, page.view_url) == (
        f"http://127.0.0.1:{port}/{TOKEN}",
        f"http://127.0.0.1:{port}/{VIEW_TOKEN}",
    )
    assert capfd.readouterr().err == addresses(port)
    assert all_there(port)
    with pytest.raises(InvalidStatus):
        Client(port, f"/{TOKEN}", origin="http://evil.example")
    get(port, f"/{TOKEN}/x", "")
    page.close()
    assert "evil.example" in caplog.text
    own = [r.getMessage() for r in caplog.records if r.name != "websockets.client"]
    assert not any(token in line for token in (TOKEN, VIEW_TOKEN) for line in own)


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_what_other_sites_ask_is_refused_before_any_work(page, port, runtime, monkeypatch, site):
    asked = []
    monkeypatch.setattr(runtime, "subscribe", lambda *about: asked.append(about))
    image = {"Sec-Fetch-Site": site, "Sec-Fetch-Mode": "no-cors", "Sec-Fetch-Dest": "image"}
    link = {"Sec-Fetch-Site": site, "Sec-Fetch-Mode": "navigate", "Sec-Fetch-Dest": "document"}
    ours = {"X-Ros-Visualise": "1"}
    for path in ("/?ask=graph", "/?%61sk=graph", "/?ask=ticks"):
        for headers in (image, link, image | ours, {"Sec-Fetch-Site": "none"}, {}):
            assert get(port, path, **headers)[0] == 403
    for path in ("/", "/?layout=x", "/no/such"):
        assert get(port, path, **image)[0] == 403
    assert get(port, "/", **link)[0] == 200
    assert not asked


def test_a_bug_in_an_answer_is_said_and_counted_and_ends_nothing(page, port, monkeypatch):
    def fail(*_):
        raise ZeroDivisionError

    own = {"X-Ros-Visualise": "1"}
    with monkeypatch.context() as broken:
        broken.setattr("ros_visualise.ui.page.graph_picture", fail)
        for _ in range(20):  # more than there are threads
            status, _, text = get(port, "/?ask=graph", **own)
            assert (status, "internal error" in text) == (500, True)
    ((failure, count),) = supervision.PROCESS.failures.items()
    assert (failure.kind, count) == ("ZeroDivisionError", 20)
    supervision.PROCESS.forget()
    assert get(port, "/?ask=graph", **own)[0] == 200


@pytest.mark.parametrize(
    ("query", "status"), [("ask=nothing", 404), ("ask=%ff", 400), ("ask=" + "x" * 9000, 414)]
)
def test_unknown_queries_are_refused_with_a_reason(page, port, query, status):
    found, _, text = get(port, f"/?{query}", **{"X-Ros-Visualise": "1"})
    assert (found, bool(json.loads(text)["error"])) == (status, True)


def test_who_asks_before_anything_is_shown_is_told_to_ask_again(port):
    early = Page(ViewOptions(port=port))
    try:
        status, _, text = get(port, "/?ask=graph", **{"X-Ros-Visualise": "1"})
        assert (status, "try again" in json.loads(text)["error"]) == (503, True)
    finally:
        early.close()


@pytest.fixture
def evil_site(port):
    """A site that somebody visits; its address."""

    class Answer(BaseHTTPRequestHandler):
        def do_GET(self):
            text = EVIL.format(port=port, token=TOKEN).encode()
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(text)

        def log_message(self, *_):
            pass

    with HTTPServer(("127.0.0.1", 0), Answer) as site:
        thread = threading.Thread(target=site.serve_forever)
        thread.start()
        yield f"http://evil.example:{site.server_port}/"
        site.shutdown()
        thread.join()


def test_a_browser_at_a_foreign_site_reaches_nothing(chromium, page, port, evil_site):
    context = chromium.new_context()
    tab = context.new_page()
    tab.goto(evil_site)
    assert tab.evaluate("() => window.told") == "closed"
    inner = tab.frames[1]
    assert not inner.url.startswith("http://127.0.0.1"), "it shows the page inside its own"
    rebound = tab.goto(f"http://evil.example:{port}/{TOKEN}")
    assert rebound.status == 403
    assert tab.goto(page.url).status == 200
    context.close()


def test_nonsense_of_all_kinds_harms_nobody(served):
    _, port = served
    rng = random.Random(11)
    first = Client(port)
    with closing(first):
        first.read_until(lambda: len(first.images) >= 3)
        for path in LIVE * 3:
            talk_nonsense(port, path, rng)
        first.read_until(lambda: len(first.images) >= 8)
    assert all_there(port)


def talk_nonsense(port, path, rng):
    """Send one kind of live data what no page of ours sends."""
    protocols = ["foxglove.websocket.v1"] if path == "/foxglove" else None
    with connect(f"ws://127.0.0.1:{port}/{TOKEN}{path}", subprotocols=protocols) as socket:
        for _ in range(40):
            try:
                socket.send(nonsense(rng))
            except ConnectionClosed:
                return


def nonsense(rng):
    """A text, bytes, or a message that is nearly right."""
    if rng.random() < 0.1:
        return rng.choice(["text", b"", b"\xc1", "[" * 60_000, rng.randbytes(200)])
    message = dict(rng.choice(RIGHT))
    for _ in range(rng.randint(1, 3)):
        key = rng.choice([*message, "do", "more"])
        message[key] = rng.choice([*WILD, {"value": rng.choice(WILD)}])
    return json.dumps(message)


@pytest.mark.parametrize("path", LIVE)
def test_messages_of_20_mib_are_not_kept(served, path):
    process, port = served
    here = Path(f"/proc/{process.pid}")
    (here / "clear_refs").write_text("5")  # the peak is that from now on
    protocols = ["foxglove.websocket.v1"] if path == "/foxglove" else None
    for _ in range(5):
        with connect(f"ws://127.0.0.1:{port}/{TOKEN}{path}", subprotocols=protocols) as socket:
            with suppress(ConnectionClosed):
                socket.send("x" * (20 << 20))
                while True:
                    socket.recv(timeout=60)
            assert socket.close_code in (1006, 1009)  # the rest of it is not read
    peak_kib = int((here / "status").read_text().partition("VmHWM:")[2].split()[0])
    assert peak_kib < 600_000
    assert all_there(port)
