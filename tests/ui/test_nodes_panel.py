"""The parameters of nodes in a real browser: dragged, typed, undone, and kept in the address."""

import pytest
from page_client import VIEW_TOKEN, wait_in

PANEL = "?layout={~panel~:~nodes~}"


@pytest.fixture
def filters(runtime):
    return runtime.parameters["filters"]


@pytest.fixture
def look(chromium, page):
    """Opens an address in a browser of its own, until the parameters are there."""
    contexts = []

    def open_tab(path=PANEL, url=page.url, width=1280):
        context = chromium.new_context(viewport={"width": width, "height": 720})
        contexts.append(context)
        tab = context.new_page()
        tab.goto(url + path)
        slider(tab, "Threshold").wait_for(timeout=60_000)
        return tab

    yield open_tab
    for context in contexts:
        context.close()


def slider(tab, label):
    return tab.get_by_role("slider", name=label, exact=True)


def field(tab, label):
    return tab.get_by_role("textbox", name=label, exact=True)


def shows(tab, value, label="Threshold"):
    return field(tab, label).input_value() == str(value)


def test_a_slider_is_dragged_seen_by_all_and_undone_as_one(look, filters):
    first, second = look(), look()
    box = slider(first, "Threshold").bounding_box()
    middle = box["y"] + box["height"] / 2
    first.mouse.move(box["x"] + box["width"] / 2, middle)
    first.mouse.down()
    first.mouse.move(box["x"] + box["width"] * 0.2, middle, steps=20)
    first.mouse.up()
    value = int(slider(first, "Threshold").input_value())
    assert value < 80
    wait_in(first, lambda: filters.current.threshold == value)
    for tab in (first, second):
        wait_in(tab, lambda tab=tab: shows(tab, value))
        assert slider(tab, "Threshold").input_value() == str(value)
        wait_in(tab, lambda tab=tab: tab.url.endswith(f"#filters/threshold={value}"))
    first.keyboard.press("Control+z")
    wait_in(first, lambda: shows(first, 128))
    wait_in(second, lambda: shows(second, 128) and "#" not in second.url)
    first.keyboard.press("Control+Shift+z")
    wait_in(first, lambda: shows(first, value))
    first.get_by_role("button", name="Reset Threshold").click()
    wait_in(first, lambda: shows(first, 128) and filters.current.threshold == 128)


def test_what_is_typed_counts_as_a_whole(look, filters):
    tab, seen = look(), []
    filters.on_change(lambda current, _: seen.append(current.threshold))
    threshold = field(tab, "Threshold")
    threshold.click()
    threshold.press("Control+a")
    tab.keyboard.type("201", delay=60)
    filters.update({"threshold": 60})  # by somebody else
    wait_in(tab, lambda: slider(tab, "Threshold").input_value() == "60")
    assert threshold.input_value() == "201"
    tab.keyboard.press("Enter")
    wait_in(tab, lambda: filters.current.threshold == 201)
    assert seen == [60, 201]

    threshold.fill("999")
    tab.keyboard.press("Tab")
    tab.locator(".rv-problem", has_text="must be from 0 to 255").wait_for()
    wait_in(tab, lambda: shows(tab, 201))
    threshold.fill("abc")
    tab.keyboard.press("Enter")
    tab.get_by_role("alert").get_by_text("Not a number").wait_for()
    threshold.fill("12")
    tab.keyboard.press("Escape")
    assert shows(tab, 201)
    threshold.press("ArrowUp")
    wait_in(tab, lambda: filters.current.threshold == 202)
    assert tab.get_by_role("alert").get_by_text("Not a number").count() == 0


def test_groups_choices_switches_presets_and_search(look, filters, runtime):
    tab = look()
    assert tab.get_by_label("Blur size").count() == 0
    tab.get_by_label("Find a parameter").fill("blur size")
    size = field(tab, "Blur size")
    size.wait_for()
    assert size.is_disabled()
    assert slider(tab, "Threshold").count() == 0
    tab.get_by_label("Find a parameter").fill("")
    tab.locator("summary", has_text="Blur").click()
    tab.get_by_label("Blur", exact=True).select_option("median")
    wait_in(tab, lambda: filters.current.blur.value == "median" and size.is_enabled())
    tab.get_by_role("switch", name="Gray").click()
    wait_in(tab, lambda: filters.current.gray is False)
    tab.get_by_label("Preset").select_option("soft")
    wait_in(tab, lambda: runtime.parameters["edge_detector"].current.low == 30)
    wait_in(tab, lambda: tab.get_by_label("Preset").input_value() == "soft")
    tab.locator("summary", has_text="fps_control").click()
    wait_in(tab, lambda: "closed" in tab.url)
    tab.reload()
    slider(tab, "Threshold").wait_for(timeout=60_000)
    assert slider(tab, "FPS").count() == 0


def test_a_choice_of_nodes_and_a_phone(look):
    tab = look("?layout={~panel~:~nodes~,~state~:{~nodes~:[~filters~]}}", width=390)
    assert slider(tab, "FPS").count() == 0
    assert tab.evaluate("document.documentElement.scrollWidth") <= 390
    tab.get_by_role("button", name="Show all").click()
    slider(tab, "FPS").wait_for()


def test_a_viewer_sees_all_and_sets_nothing(look, page, filters):
    tab = look(url=page.view_url)
    assert page.view_url.endswith(VIEW_TOKEN)
    for one in (slider(tab, "Threshold"), field(tab, "Threshold"), tab.get_by_label("Preset")):
        assert one.is_disabled()
    tab.evaluate("rv.nodes.set('filters', 'threshold', 3)")
    tab.evaluate("rv.nodes.restore('#filters/threshold=4')")
    filters.update({"threshold": 77})
    wait_in(tab, lambda: slider(tab, "Threshold").input_value() == "77")
    assert filters.current.threshold == 77


COUNT = """() => {
    window.most = 0;
    const shown = () => [...document.querySelectorAll(".q-notification:not([class*=leave])")];
    const count = () => shown().filter((one) => one.innerText.includes("is above")).length;
    const follow = () => (most = Math.max(most, count()));
    new MutationObserver(follow).observe(document.body, { childList: true, subtree: true });
}"""


def test_a_notice_replaces_the_one_that_differs_by_its_numbers(look, runtime):
    tab = look()
    tab.evaluate(COUNT)
    for low in (300, 400, 500):
        runtime.parameters["edge_detector"].update({"low": low})
        tab.get_by_text(f"low={low} is above high=200").wait_for()
    assert tab.evaluate("most") == 1
