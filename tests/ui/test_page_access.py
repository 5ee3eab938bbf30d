"""Who may come in to the page."""

import pytest
from page_client import TOKEN, VIEW_TOKEN

from ros_visualise.core.errors import UsageError
from ros_visualise.ui.server.access import Fetch, access_rules, is_loopback

OWN = "127.0.0.1:8080"


def open_to_all(host="127.0.0.1", origins=()):
    return access_rules(host, origins, token=False)


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost", "LOCALHOST", "[::1]"])
@pytest.mark.parametrize("port", ["", ":8080", ":9000"])  # of ssh -L too
def test_this_machine_comes_in_by_its_own_names(name, port):
    rules, host = open_to_all(), f"{name}{port}"
    for path in ("/", "/index.html", "/no/such?page"):
        assert rules.refusal(path, host, None) == ""
        assert rules.refusal(path, host, f"http://{host}") == ""
        assert rules.inside(path) == path


@pytest.mark.parametrize("path", ["/", "/index.html", "/no/such/page"])
@pytest.mark.parametrize(
    ("host", "origin"),
    [
        ("evil.example:8080", None),  # a name that points here all of a sudden
        ("evil.example:8080", "http://evil.example:8080"),
        ("127.0.0.1.evil.example", None),
        ("192.168.1.5:8080", None),
        ("", None),
        ("[::1", None),
        ("127.0.0.1:99999999", None),
        ("127.0.0.1:8080", "http://evil.example"),
        ("127.0.0.1:8080", "http://evil.example:8080"),
        ("127.0.0.1:8080", "http://127.0.0.1:3000"),  # another program of this machine
        ("127.0.0.1:8080", "http://127.0.0.1.evil.example:8080"),
        ("127.0.0.1:8080", "null"),  # a file, or a page in a box
        ("127.0.0.1:8080", ""),
        ("127.0.0.1:8080", "http://127.0.0.1:port"),
        ("127.0.0.1:8080", "file://"),
        ("127.0.0.1:8080", "chrome-extension://127.0.0.1:8080"),
        ("127.0.0.1:8080", "ws://127.0.0.1:8080"),
    ],
)
def test_others_are_refused_on_every_path(host, origin, path):
    assert open_to_all().refusal(path, host, origin)
    own = access_rules("127.0.0.1")
    assert own.refusal(f"/{own.token}{path}", host, origin)


def test_a_proxy_is_let_in_by_its_origin():
    rules = open_to_all(origins=["https://Robot.example.org/"])
    for host in ("robot.example.org", "127.0.0.1:8080"):
        assert rules.refusal("/", host, "https://robot.example.org") == ""
    assert rules.refusal("/", "robot.example.org", "http://robot.example.org:81")
    assert rules.refusal("/", "robot.example.org", "https://example.org")
    for site in ("http://robot.example.org", "http://robot.example.org:8080"):  # was not named
        for host in ("robot.example.org", "robot.example.org:8080", "127.0.0.1:8080"):
            assert rules.refusal("/", host, site)


@pytest.mark.parametrize(
    "origin",
    [
        *("robot.example.org", "*", "https://", "ftp://a", "https://a/b", "http://a:b", ""),
        *("https://a.b;script-src *", "https://u:p@a.b", "https://a b", "https://a.b?x"),
        *("https://a.b#c", "https://[::1", "https://a.b:999999", "https://a.b\r\nX: y"),
    ],
)
def test_what_is_no_origin_is_refused_by_name(origin):
    with pytest.raises(UsageError, match=r"give a site such as https://robot\.example\.org"):
        access_rules("127.0.0.1", [origin])


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "0.0.0.0", "::", "", "192.0.2.7"])
def test_a_token_is_needed_everywhere(host):
    rules = access_rules(host)
    called = OWN if host in ("127.0.0.1", "localhost") else "192.0.2.7:8080"
    for token in (TOKEN, VIEW_TOKEN):
        assert rules.refusal(f"/{token}", called, f"http://{called}") == ""
        assert rules.refusal(f"/{token}/index.html?a", called, None) == ""
        for path in ("/", "/index.html", f"/{token}x", f"/{token[:-1]}", f"/?{token}", "", "/%00"):
            assert "token missing" in rules.refusal(path, called, None)
        assert rules.refusal(f"/{token}", "evil.example:8080", None)
        assert rules.refusal(f"/{token}", called, "http://evil.example")
        assert rules.inside(f"/{token}") == ""
        assert rules.inside(f"/{token}/index.html") == "/index.html"
        assert rules.is_viewer(f"/{token}/x?y") == (token == VIEW_TOKEN)


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.7"])
def test_elsewhere_addresses_are_names(host):
    rules = access_rules(host)
    for called in ("192.0.2.7:8080", "127.0.0.1:8080", "[2001:db8::1]:8080"):
        assert rules.refusal(f"/{TOKEN}", called, f"http://{called}") == ""


def test_without_a_token_nobody_is_a_mere_viewer():
    rules = open_to_all()
    assert (rules.token, rules.view_token) == ("", "")
    for path in ("/", "", "/?layout=x", f"/{VIEW_TOKEN}"):
        assert rules.refusal(path, OWN, None) == ""
        assert not rules.is_viewer(path)


def test_tokens_are_made_anew_and_a_poor_one_is_refused(monkeypatch):
    monkeypatch.delenv("ROS_VISUALISE_TOKEN")
    monkeypatch.delenv("ROS_VISUALISE_VIEW_TOKEN")
    doors = [access_rules("127.0.0.1") for _ in range(20)]
    tokens = {rules.token for rules in doors} | {rules.view_token for rules in doors}
    assert len(tokens) == 40
    assert all(len(token) >= 20 for token in tokens)
    for variable in ("ROS_VISUALISE_TOKEN", "ROS_VISUALISE_VIEW_TOKEN"):
        monkeypatch.setenv(variable, "1234")
        with pytest.raises(UsageError, match=f"{variable}: give 16 to 200 letters"):
            access_rules("0.0.0.0")
        monkeypatch.setenv(variable, TOKEN)
    with pytest.raises(UsageError, match="give two different tokens"):
        access_rules("127.0.0.1")


@pytest.mark.parametrize("site", ["cross-site", "same-site", "none, cross-site", "x"])
def test_other_sites_may_only_link_here(site):
    rules, path = access_rules("127.0.0.1"), f"/{TOKEN}"
    for mode, dest in (
        *(("no-cors", "image"), ("cors", "empty"), ("navigate", "iframe"), ("navigate", "object")),
        *(("websocket", "websocket"), ("no-cors", "script"), ("", ""), ("navigate", "")),
    ):
        assert "another web site" in rules.refusal(path, OWN, None, Fetch(site, mode, dest))
    assert rules.refusal(path, OWN, None, Fetch(site, "navigate", "document")) == ""
    named = access_rules("127.0.0.1", ["https://robot.example.org"])
    assert named.refusal(path, OWN, None, Fetch(site, "navigate", "iframe")) == ""
    fetch = Fetch(site, "cors", "empty")
    assert named.refusal(path, OWN, "https://robot.example.org", fetch) == ""
    assert named.refusal(path, OWN, None, fetch)


def test_a_link_arranges_the_page_where_its_maker_knew_the_token():
    link = Fetch("cross-site", "navigate", "document")
    assert not access_rules("127.0.0.1").is_foreign(link)
    assert open_to_all().is_foreign(link)
    assert open_to_all().is_foreign(Fetch())  # of an old browser
    assert not open_to_all().is_foreign(Fetch("none", "navigate", "document"))
    assert not open_to_all().is_foreign(Fetch("same-origin", "navigate", "document"))


def test_what_is_this_machine_alone():
    assert all(map(is_loopback, ["127.0.0.1", "127.1.2.3", "::1", "localhost"]))
    assert not any(map(is_loopback, ["0.0.0.0", "", "::", "192.0.2.1", "no.such.invalid"]))
