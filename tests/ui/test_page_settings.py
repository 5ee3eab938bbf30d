"""What is arranged on the page is kept: in its address, and in a file."""

from urllib.parse import urlsplit

import pytest
from page_client import Live, wait_in

from ros_visualise.core.errors import OpenError
from ros_visualise.runtime.saving import write_yaml
from ros_visualise.ui import ViewOptions, read_arrangement
from ros_visualise.ui.page import Page

PANEL = "?layout={~panel~:~nodes~}"


@pytest.fixture
def look(browse):
    """Opens the parameters in a browser of its own."""
    return lambda path=PANEL: browse(path, images=False)


def test_reload_and_a_link_lose_nothing(look, page, runtime):
    tab = look()
    filters = runtime.parameters["filters"]
    assert "#" not in tab.url
    filters.update({"threshold": 77})
    wait_in(tab, lambda: tab.url.endswith("#filters/threshold=77"))

    # the page that goes writes its address only when the next one has the old one already
    tab.evaluate("rv.nodes.write = () => {}")
    filters.update({"threshold": 50})
    wait_in(tab, lambda: tab.evaluate("rv.nodes.values.filters.threshold") == 50)
    tab.evaluate("addEventListener('pagehide', () => rv.nodes.writeNow())")
    tab.reload()
    wait_in(tab, lambda: tab.url.endswith("#filters/threshold=50"))
    assert filters.current.threshold == 50  # what it was before is not set again

    link = f"{page.url}{PANEL}#filters/threshold=78&edge_detector/Low=33&a/b=1&windows=x"
    tab.goto("about:blank")
    tab.goto(link)
    wait_in(tab, lambda: filters.current.threshold == 78)
    wait_in(tab, lambda: runtime.parameters["edge_detector"].current.low == 33)
    kept = "#filters/threshold=78&edge_detector/low=33"
    wait_in(tab, lambda: tab.url.endswith(kept))

    other = look()
    wait_in(other, lambda: other.url == tab.url)
    filters.update({"threshold": 60})
    for one in (tab, other):
        wait_in(one, lambda one=one: "threshold=60" in one.url)
    tab.evaluate("location.hash = '#filters/gray=False'")
    wait_in(tab, lambda: filters.current.gray is False)
    runtime.playback.set_part(1.0, 2.5)
    wait_in(tab, lambda: "playback%20range/start=1&playback%20range/end=2.5" in tab.url)


def test_what_changed_before_anybody_looked_is_kept_too(look, page, runtime):
    runtime.parameters["filters"].update({"threshold": 77})
    tab = look()
    wait_in(tab, lambda: tab.url.endswith("#filters/threshold=77"))


def test_an_older_link_sets_the_3d_view(port, page):
    with Live(port, "/live/nodes") as live:
        live.read_until(lambda: "filters" in live.values)
        answer = live.answer("restore", values={"view": "1,2,3,4,5,6", "3D/Points at most": "5"})
        assert answer["reason"] == ""
        assert "six numbers" in live.answer("restore", values={"view": "1,2"})["reason"]


def test_a_link_has_the_range_that_is_played(look, page, runtime):
    tab = look(f"{PANEL}#playback%20range/start=1.5&playback%20range/end=4")
    wait_in(tab, lambda: runtime.playback.state.part_s == (1.5, 4.0))


def test_links_of_other_sites_arrange_nothing(chromium, port, runtime):
    page = Page(ViewOptions(port=port, token=False))  # without, no other site knows the address
    page.open(runtime)
    context = chromium.new_context()
    tab = context.new_page()
    tab.route(
        "http://evil.example/",
        lambda route: route.fulfill(
            body=f"<a href='{page.url}/#filters/threshold=3'>look</a>", content_type="text/html"
        ),
    )
    tab.goto("http://evil.example/")
    tab.click("a")
    wait_in(tab, lambda: tab.url == f"{page.url}/")
    assert runtime.parameters["filters"].current.threshold == 128

    asked = []
    tab.on("websocket", lambda socket: asked.append(socket.url))
    tab.goto(f"{page.url}/?websocket=ws://evil.example:{port + 1}&playbackPath=x#a=b")
    tab.locator("[data-images]").first.wait_for(timeout=120_000)
    assert f"ws://127.0.0.1:{port}/live/nodes" in asked
    assert {urlsplit(address).netloc for address in asked} == {f"127.0.0.1:{port}"}
    context.close()
    page.close()


def test_a_file_arranges_the_page(port, runtime, tmp_path):
    older = {"filters/Threshold": 60, "windows/filters": False, "playback range/Start": 1.5}
    write_yaml(older, tmp_path / "l.yaml")
    page = Page(
        ViewOptions(
            port=port, arrangement=read_arrangement(tmp_path / "l.yaml"), record_dir=tmp_path
        )
    )
    page.open(runtime)
    assert runtime.parameters["filters"].current.threshold == 60
    assert runtime.playback.state.part_s == (1.5, None)
    with Live(port, "/live/files") as client:
        client.send("save", what="layout", name="mine.yaml", layout='{"panel": "nodes"}')
        client.read_until(lambda: client.state.get("saved"))
    found = read_arrangement(tmp_path / "mine.yaml")
    assert found == {
        "filters/threshold": 60,
        "playback range/start": 1.5,
        "playback range/end": 0.0,
        "layout": '{"panel": "nodes"}',
    }
    page.close()


@pytest.mark.parametrize("text", ["[1, 2]", "a: {b: 1}", "1: 2", "a: [1]"])
def test_files_that_are_no_layout(tmp_path, text):
    (tmp_path / "l.yaml").write_text(text)
    with pytest.raises(OpenError, match="must contain lines of the form SETTING: VALUE"):
        read_arrangement(tmp_path / "l.yaml")
    with pytest.raises(OpenError, match=r"none\.yaml: no such file; did you mean l\.yaml"):
        read_arrangement(tmp_path / "none.yaml")


def test_an_address_counts_that_is_written_over_at_once(look, runtime):
    tab = look()
    filters = runtime.parameters["filters"]
    filters.update({"threshold": 60})
    wait_in(tab, lambda: "threshold=60" in tab.url)
    tab.evaluate("location.hash = '#filters/gray=False'; rv.nodes.writeNow()")
    wait_in(tab, lambda: filters.current.gray is False)
