"""Panels of the page: opened, closed, moved, dragged, undone, and kept in its address."""

import json
from contextlib import closing

import pytest
from page_client import IMAGES, wait_in

from ros_visualise.core import registry
from ros_visualise.ui import ViewOptions
from ros_visualise.ui.page import Page
from ros_visualise.ui.shell.panels import PANELS

BESIDE = "{~row~:[{~panel~:~log~},{~panel~:~topics~}],~at~:[0.72,0.28]}"


def table(tab):
    return tab.get_by_role("table", name="Topics")


def test_the_topics_have_a_line_each_and_stay_in_the_address(browse, page, runtime):
    tab = browse("?layout={~panel~:~log~}")
    assert table(tab).count() == 0
    tab.get_by_role("button", name="Topics", exact=True).click()
    row = table(tab).get_by_role("row").filter(has_text="/processed_image")
    wait_in(tab, lambda: row.count() == 1)
    assert row.bounding_box()["height"] == 22
    assert "sensor_msgs/Image" in row.inner_text()
    wait_in(tab, lambda: f"?layout={BESIDE}" in tab.url)
    runtime.parameters["filters"].update({"threshold": 77})
    wait_in(tab, lambda: tab.url.endswith(f"?layout={BESIDE}#filters/threshold=77"))
    tab.reload()
    row.wait_for(timeout=60_000)

    tab.get_by_label("Find a topic").fill("EDGES")
    wait_in(tab, lambda: row.count() == 0 and table(tab).get_by_text("/edges").count() == 1)
    tab.get_by_role("button", name="Close Topics").click()
    wait_in(tab, lambda: table(tab).count() == 0 and "topics" not in tab.url)
    tab.keyboard.press("Control+z")
    wait_in(tab, lambda: table(tab).count() == 1 and f"?layout={BESIDE}" in tab.url)


def test_a_graph_that_begins_while_the_page_loads_has_its_panels(chromium, port, runtime):
    shown, context, held, heard = Page(ViewOptions(port=port)), chromium.new_context(), [], []
    tab = context.new_page()
    tab.route("**/workspace.js*", lambda route: held.append(route))
    tab.on("websocket", lambda live: live.on("framereceived", lambda frame: heard.append(frame)))
    with closing(shown), closing(context):
        tab.goto(shown.url, wait_until="commit")
        wait_in(tab, lambda: held)
        shown.open(runtime)
        wait_in(tab, lambda: any("/processed_image" in str(frame) for frame in heard))
        for route in held:
            route.continue_()
        tab.wait_for_function(IMAGES, timeout=60_000)


def test_of_many_topics_few_are_in_the_document_and_names_are_text(browse, page):
    tab = browse("?layout={~panel~:~topics~}", images=False)
    table(tab).get_by_text("/edges").wait_for(timeout=60_000)
    names = ["/<img src=x onerror=alert(1)>", *(f"/robot/topic_{n:03}" for n in range(500))]
    rows = [[name, "a/B", 1.0, 1.0, None, n, "<b>", 2.5] for n, name in enumerate(names)]
    text = json.dumps({"rows": [*rows, ["/odd", "odd/C"]], "lines": ["<i>gone</i>: ended"]})
    page._server.topics.show(None)
    page._server.topics.put(text)
    wait_in(tab, lambda: table(tab).get_by_text("onerror=alert").count() == 1)
    assert table(tab).get_attribute("aria-rowcount") == "502"
    assert table(tab).get_by_role("row").count() < 60
    assert tab.get_by_text("<i>gone</i>: ended").count() == 1
    tab.locator(".rv-lines").evaluate("lines => lines.scrollTop = lines.scrollHeight")
    wait_in(tab, lambda: table(tab).get_by_text("unsupported type").count() == 1)
    tab.get_by_role("columnheader", name="Dropped").click()
    tab.locator(".rv-lines").evaluate("lines => lines.scrollTop = 0")
    wait_in(tab, lambda: "topic_499" in table(tab).get_by_role("row").nth(1).inner_text())
    lines = table(tab).get_by_role("row").nth(1).locator("polyline")
    assert [line.get_attribute("points") for line in lines.all()] == ["59,0", "59,0"]
    page._server.topics.put(text.replace("2.5]", "5.0]"))  # latencies
    wait_in(tab, lambda: lines.last.get_attribute("points") == "58,0.5 59,0")
    dialogs = []
    tab.on("dialog", lambda dialog: dialogs.append(dialog))
    tab.wait_for_timeout(100)
    assert not dialogs


def test_edges_are_dragged_over_frames_and_moved_by_keys(browse):
    tab = browse(f"?layout={BESIDE}")
    side = tab.locator(".rv-topics")
    side.wait_for(timeout=60_000)
    width = side.bounding_box()["width"]
    edge = tab.get_by_role("separator", name="Panel size")
    box = edge.bounding_box()
    tab.mouse.move(box["x"] + 3, 300)
    tab.mouse.down()
    tab.mouse.move(box["x"] - 97, 300, steps=8)
    tab.mouse.up()
    assert side.bounding_box()["width"] == pytest.approx(width + 100, abs=8)
    edge.press("ArrowRight")
    wait_in(tab, lambda: side.bounding_box()["width"] < width + 90)
    for part in (".rv-panel", ".rv-panel", ".rv-rail", ".rv-timeline", ".rv-panel"):
        tab.keyboard.press("F6")
        assert tab.locator(f"{part} :focus").count() == 1
    back = tab.get_by_role("button", name="Step back")
    ring = "button => getComputedStyle(button).boxShadow"
    assert back.evaluate(ring) == "none"
    back.press("Shift+Tab")
    tab.keyboard.press("Tab")
    assert back.evaluate(ring) != "none"
    tab.reload()
    side.wait_for(timeout=60_000)
    assert side.bounding_box()["width"] == pytest.approx(width + 64, abs=30)


def test_panels_are_moved_and_closed_by_keys_and_the_focus_stays_on_tabs(browse):
    tab = browse(f"?layout={BESIDE}")
    side = tab.locator(".rv-topics")
    side.wait_for(timeout=60_000)
    focused = tab.locator("[role=tab]:focus")
    tab.keyboard.press("Tab")
    focused.wait_for()  # tabs come before what they show
    tab.get_by_role("button", name="Move or split").last.press("Enter")
    item = tab.get_by_role("menu").get_by_role("listitem").first
    item.wait_for()
    wait_in(tab, lambda: tab.locator("[role=menu]:focus").count())
    tab.keyboard.press("ArrowDown")
    assert item.evaluate("item => item === document.activeElement")  # to the left
    item.press("Enter")
    wait_in(tab, lambda: side.bounding_box()["x"] == 0 and focused.count())
    assert focused.inner_text() == "Topics"
    focused.press("Delete")
    wait_in(tab, lambda: focused.count() and focused.inner_text() == "Log")
    wait_in(tab, lambda: side.count() == 0)


def test_a_panel_is_dragged_to_another_side_and_made_as_large_as_all(browse):
    tab = browse(f"?layout={BESIDE}")
    side = tab.locator(".rv-topics")
    side.wait_for(timeout=60_000)
    box = tab.get_by_role("tab", name="Topics").bounding_box()
    tab.mouse.move(box["x"] + 9, box["y"] + 9)
    tab.mouse.down()
    tab.mouse.move(300, 200, steps=4)
    tab.mouse.move(12, 300, steps=4)
    tab.mouse.up()
    wait_in(tab, lambda: side.bounding_box()["x"] == 0 and "{~row~:[{~panel~:~topics~}," in tab.url)
    size = side.bounding_box()["width"]
    tab.get_by_role("button", name="Maximise").first.click()
    wait_in(tab, lambda: side.bounding_box()["width"] > 1.5 * size)
    tab.get_by_role("button", name="Restore").click()
    wait_in(tab, lambda: side.bounding_box()["width"] == size)


def test_a_layout_is_saved_by_name(browse):
    tab = browse(f"?layout={BESIDE}")
    table(tab).wait_for(timeout=60_000)
    tab.get_by_role("button", name="Layouts").click()
    tab.get_by_label("Save as").fill("mine")
    tab.get_by_label("Save as").press("Enter")
    tab.get_by_text("Default layout").click()
    wait_in(tab, lambda: table(tab).count() == 0 and "layout" not in tab.url)
    tab.get_by_role("button", name="Layouts").click()
    tab.get_by_text("mine").click()
    wait_in(tab, lambda: table(tab).count() == 1 and "topics" in tab.url)


@pytest.mark.parametrize(
    "layout",
    [
        "{}",
        "[1,2]",
        "{~row~:" * 5000,
        "{~row~:[" * 99 + "{~panel~:~topics~}" + "]}" * 99,
        "{~panel~:~../x~}",
        "{~row~:7}",
        "{~tabs~:[{~panel~:~<img src=x>~}]}",
    ],
)
def test_a_layout_that_is_none_leaves_the_page_usable(layout, browse):
    tab = browse("?layout=" + layout[:3000], images=False)
    button = tab.get_by_role("button", name="Topics", exact=True)
    button.click(timeout=60_000)
    table(tab).wait_for(timeout=60_000)


def test_the_end_of_the_program_is_said(browse, page):
    tab = browse("")
    page.close()
    tab.get_by_text("Connection lost").wait_for(timeout=60_000)


def test_the_search_opens_panels_and_goes_to_times(browse, runtime):
    tab = browse(f"?layout={BESIDE}")
    table(tab).wait_for(timeout=60_000)
    tab.get_by_role("tab", name="Topics").focus()  # not the frame, which hears its own keys
    tab.keyboard.press("Control+k")
    field = tab.get_by_role("searchbox", name="Search the page")
    field.fill("fram")
    field.press("Enter")
    tab.get_by_text("No transforms yet").wait_for(timeout=60_000)
    tab.locator("[role=tab]:focus", has_text="Frames").wait_for()
    tab.get_by_role("tab", name="Topics").click()
    tab.get_by_role("button", name="Search the page").click()
    field.fill("frames")
    tab.get_by_role("option", name="panel Frames").click()
    tab.get_by_text("No transforms yet").wait_for(timeout=60_000)
    assert tab.get_by_role("tab", name="Frames").count() == 1  # shown again, not opened twice
    tab.get_by_role("button", name="Search the page").click()
    field.fill("thresh")
    tab.get_by_role("option", name="parameter filters/threshold", exact=True).click()
    for words in ("fps_control/fps", "filters/threshold"):
        tab.get_by_role("button", name="Search the page").click()
        field.fill(words)
        field.press("Enter")
        tab.locator(f"[data-name='{words}']:focus-within").wait_for()
        assert tab.get_by_role("tab", name="Nodes").count() == 1
    tab.get_by_role("button", name="Search the page").click()
    field.fill("0:00.5")
    field.press("Enter")
    wait_in(tab, lambda: runtime.playback.state.position_s == 0.5)
    tab.get_by_role("button", name="Search the page").click()
    first = tab.locator(".rv-search [role=option]").first
    for words, found in (
        ("slow motion", "button Playback speed"),
        ("treshold", "parameter filters/threshold"),
        ("open another video", "panel Files"),
        ("record a film", "panel Files"),
        ("map", "panel Map"),
        ("GPS", "panel Map"),
        ("webcam", "panel Files"),
        ("signals", "panel Plot"),
        ("edges height", "field /edges:height"),
    ):
        field.fill(words)
        wait_in(tab, lambda found=found: first.inner_text().replace("\n", " ") == found)
    field.fill("loop")
    field.press("Enter")
    wait_in(tab, lambda: runtime.playback.state.loop)
    tab.get_by_role("button", name="Search the page").click()
    field.fill("edges height")
    tab.get_by_role("option", name="field /edges:height").click()
    tab.locator(".rv-curve", has_text="/edges:height").wait_for(timeout=60_000)
    tab.get_by_role("button", name="Search the page").click()
    field.fill("<img src=x onerror=alert(1)>")
    tab.get_by_text("No results on this page").wait_for()
    field.fill("")
    tab.get_by_role("row", name="F6 next part of the page").wait_for()


def test_a_plot_opens_below_another_only_where_both_can_be_seen(browse):
    tab = browse("?layout={~column~:[{~panel~:~topics~},{~panel~:~log~}],~at~:[0.75,0.25]}")
    tab.get_by_role("button", name="Plot", exact=True).click()
    chart = tab.locator(".rv-chart").first
    chart.wait_for(timeout=60_000)
    assert chart.bounding_box()["height"] > 60
    assert tab.get_by_role("tab", name="Log").get_attribute("aria-selected") == "false"


def test_panels_are_found_without_imports_and_say_what_they_are():
    assert "topics" in PANELS.names()
    for panel in PANELS.all():
        assert panel.title
        assert panel.icon
        assert panel.help
    assert isinstance(PANELS, registry.Registry)
