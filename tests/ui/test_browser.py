"""Opening the page in a browser, which tells its address to nobody else."""

import webbrowser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from page_client import TOKEN
from waiting import wait_for

from ros_visualise.ui import ViewOptions
from ros_visualise.ui.page import Page


@pytest.fixture
def asked(monkeypatch):
    """What browsers were asked to open: their command lines are for all to read."""
    urls = []
    monkeypatch.setattr(webbrowser, "open", lambda url: not urls.append(url))
    return urls


def path_of(url):
    assert url.startswith("file://")
    return Path(unquote(urlsplit(url).path))


def test_the_token_is_in_a_file_of_its_owner_until_a_browser_has_come(
    port, runtime, asked, chromium
):
    page = Page(ViewOptions(port=port, browser=True))
    page.open(runtime)
    try:
        (url,) = wait_for(lambda: asked, "the browser")
        assert TOKEN not in url
        path = path_of(url)
        assert path.parent.stat().st_mode & 0o077 == 0
        context = chromium.new_context()
        tab = context.new_page()
        tab.goto(url)
        tab.wait_for_url(f"{page.url}**", timeout=60_000)
        assert tab.title() == "ros_visualise"
        tab.locator("[data-images]").first.wait_for(timeout=120_000)
        wait_for(lambda: not path.parent.exists(), "the file's end")
        context.close()
    finally:
        page.close()


def test_no_file_is_left_of_a_page_that_nobody_opened(port, runtime, asked):
    page = Page(ViewOptions(port=port, browser=True))
    page.open(runtime)
    (url,) = wait_for(lambda: asked, "the browser")
    assert path_of(url).exists()
    page.close()
    assert not path_of(url).parent.exists()


def test_without_a_browser_a_person_is_asked_to_open_it(port, runtime, monkeypatch, capfd):
    monkeypatch.setattr(webbrowser, "open", lambda url: False)
    page = Page(ViewOptions(port=port, browser=True))
    page.open(runtime)
    said = []
    wait_for(
        lambda: said.append(capfd.readouterr().err) or "no browser opened" in "".join(said),
        "the line",
    )
    page.close()
