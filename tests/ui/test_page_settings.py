"""What is arranged on the page is kept: in its address, and in a file."""

from urllib.parse import urlsplit

import pytest
from page_client import Client, wait_in

from ros_visualise.core.errors import OpenError
from ros_visualise.runtime.saving import write_yaml
from ros_visualise.ui import ViewOptions, read_arrangement
from ros_visualise.ui.page import Page
from ros_visualise.ui.shell import VISER


def test_reload_and_a_link_lose_nothing(browse, page, runtime):
    tab = browse("")
    filters = runtime.parameters["filters"]
    assert "#" not in tab.url
    filters.update({"threshold": 77})
    wait_in(tab, lambda: tab.url.endswith("#filters/threshold=77"))

    filters.update({"threshold": 50})
    tab.reload()
    wait_in(tab, lambda: tab.url.endswith("#filters/threshold=50"))
    assert filters.current.threshold == 50  # what it was before is not set again

    link = f"{page.url}#filters/threshold=78&a/b=1&windows=x"
    tab.goto("about:blank")
    tab.goto(link)
    wait_in(tab, lambda: filters.current.threshold == 78)
    wait_in(tab, lambda: tab.url.endswith("#filters/threshold=78"))

    other = browse("")
    wait_in(other, lambda: other.url == tab.url)
    filters.update({"threshold": 60})
    for one in (tab, other):
        wait_in(one, lambda one=one: "threshold=60" in one.url)


def test_what_changed_before_anybody_looked_is_kept_too(browse, page, runtime):
    runtime.parameters["filters"].update({"threshold": 77})
    tab = browse()
    wait_in(tab, lambda: tab.url.endswith("#filters/threshold=77"))


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
    assert f"ws://127.0.0.1:{port}{VISER}" in asked
    assert {urlsplit(address).netloc for address in asked} == {f"127.0.0.1:{port}"}
    context.close()
    page.close()


def test_a_file_arranges_the_page(port, runtime, tmp_path):
    write_yaml({"filters/threshold": 60, "windows/filters": False}, tmp_path / "l.yaml")
    page = Page(
        ViewOptions(
            port=port, arrangement=read_arrangement(tmp_path / "l.yaml"), record_dir=tmp_path
        )
    )
    page.open(runtime)
    client = Client(port)
    client.read_until(lambda: runtime.parameters["filters"].current.threshold == 60)
    client.read_until(lambda: client.values["filters"] is False)
    client.set("Layout", "mine.yaml")
    client.set("Save layout", True)
    client.read_until(lambda: (tmp_path / "mine.yaml").exists())
    client.read_until(lambda: (tmp_path / "mine.yaml").read_text() != "")
    found = read_arrangement(tmp_path / "mine.yaml")
    assert found == {"filters/threshold": 60, "windows/filters": False}
    client.close()
    page.close()


@pytest.mark.parametrize("text", ["[1, 2]", "a: {b: 1}", "1: 2", "a: [1]"])
def test_files_that_are_no_layout(tmp_path, text):
    (tmp_path / "l.yaml").write_text(text)
    with pytest.raises(OpenError, match="must hold lines SETTING: VALUE"):
        read_arrangement(tmp_path / "l.yaml")
    with pytest.raises(OpenError, match=r"none\.yaml: no such file; did you mean l\.yaml"):
        read_arrangement(tmp_path / "none.yaml")
