"""Both printed addresses in a real browser: one changes things, the other one only looks."""

import re

import pytest
from page_client import IMAGES, TOKEN, VIEW_TOKEN, wait_in
from test_page_browser import slider, value_of


@pytest.fixture
def printed(capfd, page):
    """The addresses as a person reads them: the one for everything, and the read-only one."""
    return re.findall(r"http://\S+", capfd.readouterr().err.replace(";", ""))


@pytest.fixture
def visit(chromium):
    """Opens an address in a browser of its own, which notes what it asks for."""
    contexts = []

    def open_tab(address):
        context = chromium.new_context(viewport={"width": 1280, "height": 720})
        contexts.append(context)
        context.set_default_timeout(120_000)
        tab = context.new_page()
        tab.goto(address)
        tab.wait_for_function(IMAGES)
        return tab

    yield open_tab
    for context in contexts:
        context.close()


def test_both_printed_addresses_open_and_one_is_read_only(printed, visit, runtime):
    own, view = printed
    assert own.endswith(f"/{TOKEN}")
    assert view.endswith(f"/{VIEW_TOKEN}")
    looking, working = visit(view), visit(own)
    assert [looking.url, working.url] == [view, own]
    assert looking.get_by_role("button", name="Play").is_disabled()
    assert [tab.get_by_text("Read-only").count() for tab in (looking, working)] == [1, 0]
    assert slider(looking, "Threshold").is_disabled()
    assert slider(working, "Threshold").is_enabled()
    looking.keyboard.press("Space")  # plays
    assert value_of(looking, "Threshold") == 128

    runtime.parameters["filters"].update({"threshold": 77})
    for tab in (looking, working):
        wait_in(tab, lambda tab=tab: value_of(tab, "Threshold") == 77)
    working.keyboard.press("Space")
    wait_in(working, lambda: runtime.playback.state.playing)


def test_close_up_pages_and_downloads_go_by_the_same_address(printed, visit, runtime, tmp_path):
    for address in reversed(printed):  # the read-only one first, while nothing plays
        tab = visit(address)
        with tab.expect_download(timeout=120_000) as saved:
            tab.get_by_role("button", name="Save PNG").first.click()
        assert saved.value.suggested_filename.startswith("controlled_stream_")


def test_a_download_by_the_read_only_address(page, printed, visit, runtime, tmp_path):
    (tmp_path / "mine.mcap").write_bytes(bytes(range(256)) * 100)
    page._files.recorded(tmp_path / "mine.mcap")
    for address in printed:
        tab = visit(address + "?layout={~row~:[{~panel~:~image~},{~panel~:~files~}]}")
        with tab.expect_download(timeout=120_000) as saved:
            tab.locator("[data-download]").click()
        assert saved.value.path().read_bytes() == (tmp_path / "mine.mcap").read_bytes()
