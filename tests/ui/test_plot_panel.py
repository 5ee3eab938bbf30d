"""The panel of plots in a browser: found, dragged, zoomed, saved and kept in the address."""

import csv
import io
import json
import re
from urllib.parse import quote

import numpy as np
import pytest
from page_client import wait_in
from scene_messages import odometry

from ros_visualise.data import Odometry, Text
from ros_visualise.graph.pipelines import recording_pipeline
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sinks import open_recorder
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.playback import Playback

X, Y = "/odom:pose.pose.position.x", "/odom:pose.pose.position.y"
COUNT, STEP_S = 2001, 0.01
SMALL = 0.1234567890123


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Twenty seconds: a sawtooth about zero, and a number that needs all digits."""
    path = tmp_path_factory.mktemp("plots") / "odom.mcap"
    topics = {"/odom": TopicType(Odometry.type_name), "/said": TopicType(Text.type_name)}
    with open_recorder(str(path), topics) as recorder:
        recorder.write("/said", Text("The landing begins"), 1012 * 10**9)
        for number in range(COUNT):
            at = number * STEP_S
            place = [0.1 * ((number % 7) - 3), SMALL * number, 0]
            recorder.write("/odom", odometry(place, 1000 + at), round((1000 + at) * 1e9))
    return path


@pytest.fixture
def runtime(recorded):
    playback = Playback(hold=True)
    playback.pause()
    running = LocalRuntime(recording_pipeline(open_recording(recorded)), playback)
    running.start()
    yield running
    running.stop()


def layout(**state):
    text = json.dumps({"panel": "plots", "state": state}, separators=(",", ":"))
    return "?layout=" + quote(text.translate(str.maketrans('"~', '~"')))


@pytest.fixture
def plot(browse):
    """A page with this panel alone, in that state."""

    def open_plot(**state):
        tab = browse(layout(**state), images=False)
        tab.locator(".rv-chart canvas").first.wait_for(timeout=60_000)
        return tab

    return open_plot


def value(tab, name):
    return tab.locator(".rv-curve", has_text=name).first.locator("b").inner_text()


def saved(tab, kind):
    tab.get_by_role("button", name="Save", exact=True).click()
    with tab.expect_download(timeout=60_000) as download:
        tab.get_by_text(kind, exact=True).click()
    return download.value.path().read_bytes()


def chart_box(tab, number=0):
    return tab.locator(".rv-chart").nth(number).bounding_box()


def test_curves_are_found_derived_undone_and_kept(plot, runtime):
    runtime.playback.seek(1.0)
    tab = plot()
    tab.get_by_role("button", name="Add curves").click()
    tab.get_by_label("Find a field").fill("position y")
    tab.get_by_role("treeitem", name="pose.pose.position.y").click(timeout=60_000)
    tab.keyboard.press("Escape")
    wait_in(tab, lambda: value(tab, Y) == "12.34568")
    tab.get_by_role("button", name=f"Curve {Y}").click()
    tab.get_by_text("Derivative", exact=True).click()
    derived = f'=derivative("{Y}")'
    wait_in(tab, lambda: value(tab, derived) == "12.34568")
    wait_in(tab, lambda: "derivative(" in tab.url)
    tab.reload()
    wait_in(tab, lambda: tab.locator(".rv-curve").count() == 2 and value(tab, derived))
    tab.get_by_role("button", name=f"Remove {derived}").click()
    wait_in(tab, lambda: tab.locator(".rv-curve").count() == 1)
    tab.keyboard.press("Control+z")
    wait_in(tab, lambda: tab.locator(".rv-curve").count() == 2)


def test_fields_that_load_slowly_are_shown_too(plot):
    tab = plot()

    def delay(route):
        tab.wait_for_timeout(500)
        route.continue_()

    tab.route("**/field_list.js*", delay)
    tab.get_by_role("button", name="Add curves").click()
    tab.get_by_label("Find a field").fill("position y", timeout=20_000)
    tab.get_by_role("treeitem", name="pose.pose.position.y").wait_for(timeout=60_000)


def test_a_click_seeks_a_drag_zooms_and_a_double_click_fits(plot, runtime):
    tab = plot(panes=[{"curves": [X]}, {"curves": [Y]}])
    wait_in(tab, lambda: value(tab, Y) == "0")
    box = chart_box(tab)
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    tab.mouse.click(*middle)
    wait_in(tab, lambda: runtime.playback.state.position_s == pytest.approx(10, abs=0.5))
    tab.mouse.move(*middle)
    tab.mouse.down()
    tab.mouse.move(middle[0] + 200, middle[1], steps=5)
    tab.mouse.up()
    wait_in(tab, lambda: "window" in tab.url)
    start, end = map(float, re.search(r"window~:\[([\d.]+),([\d.]+)", tab.url).groups())
    assert start == pytest.approx(10, abs=0.5)
    assert 1 < end - start < 6
    tab.mouse.wheel(0, -200)
    wait_in(tab, lambda: f"{start}" not in tab.url)
    tab.mouse.dblclick(*middle)
    wait_in(tab, lambda: "window" not in tab.url)


def test_the_cursor_is_one_for_all_panes_and_gives_values(plot):
    tab = plot(panes=[{"curves": [X]}, {"curves": [Y]}])
    wait_in(tab, lambda: value(tab, Y) == "0")
    box = chart_box(tab)
    tab.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    wait_in(tab, lambda: tab.locator(".rv-pointed:visible").count() == 2)
    at = tab.evaluate("rv.cursor.at")
    wait_in(tab, lambda: value(tab, Y) == f"{SMALL * int(at / STEP_S):.7g}")


def test_a_table_has_all_digits_of_derived_curves_too(plot):
    tab = plot(panes=[{"curves": [Y, f'="{Y}"*3']}])
    rows = list(csv.reader(io.StringIO(saved(tab, "CSV").decode())))
    assert rows[0] == ["time", "stamp", Y, f'="{Y}"*3']
    assert len(rows) == COUNT + 1
    numbers = np.array(rows[1:], np.float64)
    assert numbers[:, 2].tolist() == [SMALL * number for number in range(COUNT)]
    assert numbers[:, 3].tolist() == [SMALL * number * 3 for number in range(COUNT)]
    assert rows[2][:2] == ["0.010000000", "1000.010000000"]


def labels(svg):
    return re.findall(r"<text[^>]*>([^<]*)</text>", svg)


def test_pictures_have_labels_that_people_read(plot):
    tab = plot(panes=[{"curves": [X]}])
    tab.evaluate("rv.clock.act({ mark: [5, '<b>turn</b>'] })")
    wait_in(tab, lambda: value(tab, X))
    wait_in(tab, lambda: "&lt;b&gt;turn&lt;/b&gt;" in labels(saved(tab, "SVG").decode()))
    found = labels(saved(tab, "SVG").decode())
    assert {"0", "-0.3", "0.3", "m", "0:06", f"{X} [m]"} <= set(found)
    assert not re.search(r"\de-?\d", " ".join(found))
    assert saved(tab, "PNG")[:4] == b"\x89PNG"
    tab.get_by_role("button", name="Add an expression").click()
    field = tab.get_by_role("textbox", name="Expression")
    field.fill(f'"{X}" * 1e-9')
    field.press("Enter")
    wait_in(tab, lambda: {"0", "3e-10", "-3e-10"} <= set(labels(saved(tab, "SVG").decode())))


@pytest.mark.parametrize(
    "state",
    [
        {"window": [5, 5]},
        {"window": [5, 5 + 1e-15]},
        {"window": [1e300, -1e300]},
        {"window": [None, "x"]},
        {"window": [-1e8, 1e8]},
    ],
)
def test_at_extreme_zoom_there_are_few_ticks(plot, state):
    tab = plot(panes=[{"curves": [Y, "/odom:pose.pose.position.z"]}], **state)
    wait_in(tab, lambda: value(tab, Y))
    assert 2 <= len(labels(saved(tab, "SVG").decode())) < 60
    tab.get_by_role("button", name="Fit").click()
    wait_in(tab, lambda: "0:06" in labels(saved(tab, "SVG").decode()))


def test_foreign_states_are_a_plot_all_the_same(plot):
    name = '/<img src=x onerror=alert(1)>:"x'
    panes = [None, {"kind": "__proto__", "curves": [5, name]}, {"kind": "xy", "curves": [X]}]
    tab = plot(panes=panes, last="x")
    dialogs = []
    tab.on("dialog", lambda dialog: dialogs.append(dialog))
    tab.get_by_role("status").get_by_text("no such topic").wait_for(timeout=60_000)
    wait_in(tab, lambda: value(tab, X))
    assert not dialogs


def test_a_curve_without_numbers_says_so_and_messages_are_searched(plot, runtime):
    tab = plot(panes=[{"curves": [f'="{X}" * 0 / 0']}])
    tab.get_by_role("status").get_by_text("no finite numbers").wait_for(timeout=60_000)
    tab.keyboard.press("Control+k")
    tab.get_by_role("searchbox", name="Search the page").fill("landing")
    tab.get_by_role("option", name="message 0:12.00 /said The landing begins").click()
    wait_in(tab, lambda: runtime.playback.state.position_s == 12)
    tab.get_by_role("tab", name="/said").wait_for(timeout=60_000)


def test_spectra_and_one_curve_against_another(plot):
    panes = [{"kind": "spectrum", "curves": [X]}, {"kind": "xy", "x": X, "curves": [Y]}]
    tab = plot(panes=panes)
    wait_in(tab, lambda: value(tab, Y) == "0")
    found = labels(saved(tab, "SVG").decode())
    assert {"Hz", X, f"{Y} [m]"} <= set(found)
    box = chart_box(tab, 1)
    assert tab.locator(".rv-dot:visible").count() == 1
    tab.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
