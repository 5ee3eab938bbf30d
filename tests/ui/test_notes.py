"""Notes of a recording: kept beside its marks, in a hub of its own and in a real browser."""

import pytest
from hub_client import HubClient
from scene_runtime import Told
from waiting import wait_for

from ros_visualise.core.errors import UsageError
from ros_visualise.core.yaml_files import load_yaml
from ros_visualise.data import Text
from ros_visualise.ui import ViewOptions
from ros_visualise.ui.file_chooser import FileChooser
from ros_visualise.ui.live.marks import SUFFIX, Marks
from ros_visualise.ui.live.notes import NotesHub
from ros_visualise.ui.page import Page
from ros_visualise.ui.server.host import page_loop

WILD = "# Take-off\n\n- 'a': \"b\" #c\n\t\ttabs \\ and \u2028 lines é 🚁\n---\n...\n  end  \n"


@pytest.mark.parametrize("text", ["", "one", WILD, "x" * 50_000, "\ud800", "\x00\x07"])
def test_notes_are_kept_with_the_marks(tmp_path, text):
    film = tmp_path / "film.mp4"
    marks = Marks(film)
    marks.set(1.5, "take-off")
    marks.note(text)
    again = Marks(film)
    assert again.notes == text
    again.set(2, "landing")
    assert list(Marks(film).names.values()) == ["take-off", "landing"]
    assert Marks(film).notes == again.notes
    with pytest.raises(UsageError, match="50000"):
        marks.note("x" * 50_001)


@pytest.mark.parametrize("text", ["marks: []\nnotes: 5", "marks: []\nnotes: [a]", "notes: a"])
def test_other_files_are_refused(tmp_path, text):
    (tmp_path / f"a.mcap{SUFFIX}").write_text(text)
    with pytest.raises(UsageError):
        Marks(tmp_path / "a.mcap")


def test_all_browsers_have_the_last_notes(tmp_path):
    hub = NotesHub(page_loop(), pytest.fail)
    marks = Marks(tmp_path / "film.mp4")
    hub.follow(marks)
    with HubClient(hub) as one, HubClient(hub) as other, HubClient(hub, is_viewer=True) as viewer:
        for browser in (one, other, viewer):
            assert browser.read()[-1] == {"text": "", "file": f"film.mp4{SUFFIX}", "by": ""}
        viewer.send(do="write", text="never", by="v")
        one.send(do="write", text="x" * 60_000, by="a")
        one.send("no request")
        one.send(do="write", text="first", by="a")
        for browser in (one, other, viewer):
            assert browser.read()[-1]["text"] == "first"
        other.send(do="write", text="second", by="b")
        assert one.read()[-1]["by"] == "b"
        hub.follow(Marks())
        assert viewer.read_until(lambda all_: all_[-1]["file"] == "")[-1]["text"] == ""
    hub.close()
    assert load_yaml(marks.path)["notes"] == "second"


def test_the_panel(chromium, port, tmp_path):
    film = tmp_path / "film.mp4"
    page = Page(ViewOptions(port=port, chooser=FileChooser(tmp_path, tmp_path, film)))
    page.open(Told(text=Text))
    context = chromium.new_context(viewport={"width": 600, "height": 500})
    try:
        tab, viewer = context.new_page(), context.new_page()
        tab.goto(page.url + "?layout={~panel~:~notes~}")
        tab.get_by_role("button", name="Edit").click()
        tab.get_by_role("textbox", name="Notes").fill(
            "# Flight\n- **bold** at 1:23.5\n- <img src=x onerror=alert(1)>"
        )
        wait_for(lambda: Marks(film).notes, sleep=lambda s: tab.wait_for_timeout(1000 * s))
        tab.get_by_role("button", name="Read").click()
        tab.locator("h3", has_text="Flight").wait_for()
        tab.get_by_role("button", name="1:23.5").wait_for()
        assert tab.locator(".rv-notes b").inner_text() == "bold"
        assert tab.locator(".rv-notes img").count() == 0
        viewer.goto(page.view_url + "?layout={~panel~:~notes~}")
        viewer.locator("h3", has_text="Flight").wait_for()
        assert viewer.get_by_role("button", name="Edit").is_disabled()
    finally:
        context.close()
        page.close()
