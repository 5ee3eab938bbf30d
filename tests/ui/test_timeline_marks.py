"""Marks on the timeline: set, named, removed, kept in a file beside the recording."""

import json
import subprocess
import sys
from contextlib import closing

import forked
import pytest
from made_videos import numbered, write_video
from page_client import TOKEN, VIEW_TOKEN, ClockClient, get
from waiting import wait_for

from ros_visualise.commands import main
from ros_visualise.core.errors import RosVisualiseError, UsageError
from ros_visualise.core.yaml_files import load_yaml
from ros_visualise.sources.opening import open_recording
from ros_visualise.ui.live.marks import SUFFIX, Marks
from ros_visualise.ui.server.answers import HEADER


def test_marks_are_kept_in_order_of_time(tmp_path):
    film = tmp_path / "film.mp4"
    marks = Marks(film)
    marks.set(2.5, "  landing\n at last ")
    marks.set(1.23456, "take-off")
    again = Marks(film)
    assert list(again.names.items()) == [(1.235, "take-off"), (2.5, "landing at last")]
    again.set(2.5, "")
    again.set(9, "never there")
    again.set(9, "")
    stored = load_yaml(tmp_path / ("film.mp4" + SUFFIX))
    assert stored == {"marks": [{"time": 1.235, "name": "take-off"}]}


@pytest.mark.parametrize(
    "text",
    [
        *("[", "7", "marks: 5", "marks: [5]", "marks: [{time: 1}]"),
        *(f"marks: [{{time: {at}, name: a}}]" for at in ("-1", ".nan", "true", "[1]", "1e12")),
        "marks: [{time: 1, name: [a]}]",
    ],
)
def test_other_files_are_refused_and_left_alone(tmp_path, text):
    path = tmp_path / f"x.mcap{SUFFIX}"
    path.write_text(text)
    with pytest.raises(RosVisualiseError, match="marks"):
        Marks(tmp_path / "x.mcap")
    assert path.read_text() == text


def test_new_marks_get_the_next_free_name():
    marks = Marks()
    for at_s in (1.0, 2.0, 2.0004):  # the last two are one
        marks.add(at_s)
    marks.set(1.0, "")
    marks.add(3.0)
    assert marks.names == {2.0: "Mark 2", 3.0: "Mark 3"}


def test_there_is_a_limit():
    marks = Marks()
    for number in range(1000):
        marks.set(number, "a")
    with pytest.raises(UsageError, match="1000 marks already"):
        marks.set(1000, "a")
    marks.set(999, "renamed")
    assert marks.names[999] == "renamed"


@pytest.fixture
def recording(tmp_path, port):
    """A recording, shown by the command."""
    write_video(tmp_path / "one.mkv", numbered(10))
    path = tmp_path / "one.bag"
    played = ["video", str(tmp_path / "one.mkv"), "--view", "none", "--rate", "0"]
    assert main([*played, "--record", f"{path}@/image_raw"]) == 0
    shown = ["bag", str(path), "--port", str(port), "--no-open"]
    with forked.Forked(
        [sys.executable, "-m", "ros_visualise", *shown], stderr=subprocess.PIPE, text=True
    ) as process:
        assert any("open http" in line for line in process.stderr)
        yield path
        process.terminate()
        process.communicate()


def test_a_browser_sets_marks_and_a_viewer_does_not(recording, port):
    with ClockClient(port, TOKEN) as clock, ClockClient(port, VIEW_TOKEN) as viewer:
        clock.act(seek=0.2)
        clock.act(toggle=1)
        clock.read_until(lambda state: state.get("position") == 0.2)
        viewer.act(mark=[1.0, "not mine"])
        clock.act(mark=[2.0, "<b>"])
        for wild in (None, 5, [], [1], [1, 2], ["x", "y"], [float("nan"), "n"], [True, "t"]):
            clock.act(mark=wild)
        clock.act(mark=[None, ""])
        shown = viewer.read_until(lambda state: len(state.get("marks", ())) == 2)
    assert shown["marks"] == [[0.2, "Mark 2"], [2.0, "<b>"]]
    wait_for(lambda: Marks(recording).names == {0.2: "Mark 2", 2.0: "<b>"})


def test_messages_of_each_topic_are_counted_along_the_time(recording, port):
    with ClockClient(port, TOKEN) as clock:
        clock.read_until(lambda state: state.get("duration"))
    status, _, text = get(port, "/?ask=ticks", **{HEADER: "1"})
    assert status == 200
    counts = json.loads(text)["topics"]
    with closing(open_recording(recording)) as opened:
        stamps = opened.stamps_ns()
    assert {topic: sum(bins) for topic, bins in counts.items()} == {
        topic: len(found) for topic, found in stamps.items()
    }
    assert len(counts["/image_raw"]) == 500
    assert max(counts["/image_raw"]) == 1
    recording.rename(recording.with_suffix(".moved"))
    assert get(port, "/?ask=ticks", **{HEADER: "1"})[2] == '{"topics": {}}'


def test_a_person_sets_and_removes_a_mark_and_sees_the_messages(chromium, recording, port):
    context = chromium.new_context(viewport={"width": 1280, "height": 720})
    tab = context.new_page()
    tab.goto(f"http://127.0.0.1:{port}/{TOKEN}")
    bar = tab.get_by_role("slider", name="Time")
    wait_for(lambda: "0:00.36" in bar.get_attribute("aria-valuetext"), "the end, where it stays")
    tab.get_by_role("button", name="Set a mark").click()
    mark = tab.get_by_role("button", name="Mark Mark 1")
    mark.wait_for(timeout=60_000)
    bar.press("Home")
    wait_for(lambda: "0:00.00" in bar.get_attribute("aria-valuetext"))
    bar.press("m")
    wait_for(lambda: len(Marks(recording).names) == 2)
    mark.click(button="right")
    tab.get_by_label("Name of the mark").fill("touchdown")
    tab.get_by_role("button", name="Rename").click()
    tab.get_by_role("button", name="Mark touchdown").click(button="right")
    tab.get_by_role("button", name="Loop from here to the next mark").click()
    loops = tab.get_by_role("button", name="Loop", exact=True)
    wait_for(lambda: loops.get_attribute("aria-pressed") == "true", "the loop")
    tab.get_by_role("button", name="Mark touchdown").click(button="right")
    tab.get_by_role("button", name="Remove").click()
    wait_for(lambda: len(Marks(recording).names) == 1)
    tab.get_by_role("button", name="Messages per topic").click()
    tab.get_by_role("img", name="Messages over time").wait_for(timeout=60_000)
    context.close()
