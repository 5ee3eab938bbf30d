"""The 3D view in a real browser: what is drawn, clicked, and kept in the address."""

import io
from contextlib import closing

import numpy as np
import pytest
from page_client import VIEW_TOKEN, wait_in
from PIL import Image as Pillow
from scene_messages import S, tf, transform
from scene_runtime import Told

from ros_visualise.data import (
    Header,
    Marker,
    MarkerAction,
    MarkerArray,
    MarkerType,
    PoseStamped,
    Transforms,
)
from ros_visualise.ui import ViewOptions
from ros_visualise.ui.page import Page

ALONE = "?layout={~panel~:~space~}"
NO_WEBGL = """
const own = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
  return kind.startsWith("webgl") ? null : own.call(this, kind, ...rest);
};
"""


@pytest.fixture
def runtime():
    return Told(inputs={"goal": PoseStamped}, tf=Transforms, shapes=MarkerArray, others=MarkerArray)


@pytest.fixture
def page(port, runtime):
    page = Page(ViewOptions(port=port))
    page.open(runtime)
    yield page
    page.close()


@pytest.fixture
def visit(chromium, page):
    """Opens the 3D view in a browser of its own; its tab has a list of what the console says."""
    contexts = []

    def open_tab(path=ALONE, address=None, script=None, **options):
        options = {"viewport": {"width": 800, "height": 600}, "color_scheme": "dark"} | options
        contexts.append(chromium.new_context(**options))
        tab = contexts[-1].new_page()
        if script:
            tab.add_init_script(script)
        tab.said = []
        tab.on("console", lambda message: tab.said.append(f"{message.type}: {message.text}"))
        tab.on("pageerror", lambda error: tab.said.append(f"error: {error}"))
        tab.goto((address or page.url) + path)
        return tab

    yield open_tab
    for context in contexts:
        context.close()


def cube(x, number=0, stamp_s=1.0, alpha=1):
    header = Header(int(stamp_s * S), "map")
    color = np.array([1, 0, 0, alpha], np.float32)
    size = np.array([2.0, 2, 2])
    place = np.array([x, 0.0, 0])
    return Marker(
        MarkerType.CUBE, place, scale_xyz=size, color_rgba=color, id=number, header=header
    )


def publish(runtime, x=0.0):
    runtime.say(tf=tf(transform("map", "base_link", [0, 0, 0], 1)))
    runtime.say(shapes=MarkerArray((cube(x),)))


def canvas(tab):
    return tab.locator(".rv-space-room canvas")


def pixels(tab):
    """The canvas as a person sees it, RGB."""
    shot = canvas(tab).screenshot()
    return np.asarray(Pillow.open(io.BytesIO(shot)).convert("RGB")).astype(int)


def reds(tab):
    """Middle of what is red, as shares of width and height; None without any."""
    shown = pixels(tab)
    rows, columns = np.nonzero((shown[:, :, 0] > 60) & (shown[:, :, 1:].max(axis=2) < 40))
    if len(rows) < 300:
        return None
    return columns.mean() / shown.shape[1], rows.mean() / shown.shape[0]


def is_straight_ahead(tab):
    found = reds(tab)
    return found is not None and abs(found[0] - 0.5) < 0.1


def test_a_cube_is_red_moves_and_is_seen_in_both_themes(visit, runtime):
    publish(runtime)
    dark, light = visit(), visit(color_scheme="light")
    for tab in (dark, light):
        wait_in(tab, lambda tab=tab: is_straight_ahead(tab))
    corners = [pixels(tab)[-5, 5].mean() for tab in (dark, light)]
    assert corners[0] < 80
    assert corners[1] > 180
    dark.get_by_label("Follow").select_option("")
    before = reds(dark)
    runtime.say(tf=tf(transform("map", "base_link", [0, 2, 0], 2)))
    wait_in(light, lambda: (reds(light) or before)[0] > before[0] + 0.05)
    assert reds(dark)[0] == pytest.approx(before[0], abs=0.02), "it follows nothing"


def test_nothing_is_said_in_the_console_while_much_moves(visit, runtime):
    publish(runtime)
    tab = visit()
    wait_in(tab, lambda: reds(tab))
    runtime.say(others=MarkerArray((cube(3.0, alpha=0.5),)))  # is drawn last
    texts = [
        Marker(MarkerType.TEXT_VIEW_FACING, text=f"{n}", id=100 + n, header=Header(S, "map"))
        for n in range(20)
    ]
    everything = Marker(MarkerType.CUBE, action=MarkerAction.DELETEALL)
    for step in range(60):
        moved = tuple(cube(step / 60, n, 1 + step) for n in range(1 + step % 30))
        runtime.say(shapes=MarkerArray((everything, *moved, *texts[: step % 20])))
        runtime.say(tf=tf(transform("map", "base_link", [0, 0, 0], 1 + step)))
        tab.wait_for_timeout(30)
    packets = int(canvas(tab).get_attribute("data-packets"))
    assert packets > 5
    drawn_by_software = "GPU stall due to ReadPixels"
    assert [line for line in tab.said if drawn_by_software not in line] == []


def test_clicks_tell_coordinates_distances_and_send_goals(visit, runtime):
    publish(runtime, 3.0)
    tab = visit()
    wait_in(tab, lambda: reds(tab))
    tab.get_by_role("button", name="View from above").click()
    said = tab.locator(".rv-space-said")
    tab.get_by_label("Click").select_option("place")
    box = canvas(tab).bounding_box()
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    tab.mouse.click(*middle)
    wait_in(tab, lambda: said.count() and "m in map" in said.inner_text())
    tab.get_by_label("Click").select_option("distance")
    wait_in(tab, lambda: not said.count())
    tab.mouse.click(*middle)
    wait_in(tab, lambda: said.count() and said.inner_text().startswith("x "))
    tab.mouse.click(middle[0] + 90, middle[1])
    wait_in(tab, lambda: " m (x +" in said.inner_text())
    tab.get_by_label("Click").select_option("goal /goal")
    tab.mouse.click(middle[0], middle[1] + 60)
    wait_in(tab, lambda: "Goal sent: x " in ((said.count() and said.inner_text()) or ""))
    topic, goal = runtime.taken[-1]
    assert (topic, goal.header.frame_id) == ("/goal", "map")


def test_the_view_and_the_settings_are_kept_in_the_address(visit, runtime, page):
    publish(runtime)
    tab = visit()
    wait_in(tab, lambda: is_straight_ahead(tab))
    canvas(tab).focus()
    for _ in range(8):
        tab.keyboard.press("ArrowRight")
    tab.keyboard.press("-")
    tab.get_by_label("Follow").select_option("map")
    tab.get_by_role("button", name="Settings").click()
    tab.get_by_label("Frame names").check()
    tab.get_by_role("button", name="Undo").click()
    wait_in(tab, lambda: not page._server.space.scene.appearance.names)
    tab.get_by_role("button", name="Redo").click()
    for kept in ("~view~:[", "~follow~:~map~", "frame%20names~:true"):
        wait_in(tab, lambda kept=kept: kept in tab.url)
    tab.get_by_role("button", name="Settings").click()
    tab.wait_for_timeout(300)
    shown = pixels(tab)
    other = visit(tab.url.removeprefix(page.url))
    wait_in(other, lambda: reds(other))
    wait_in(other, lambda: np.abs(pixels(other) - shown).mean() < 2)
    tab.get_by_role("button", name="Reset view").click()
    wait_in(tab, lambda: "~view~" not in tab.url)


def test_without_webgl_it_says_so_and_the_settings_work(visit, runtime, page):
    publish(runtime)
    tab = visit(script=NO_WEBGL)
    tab.get_by_role("alert").get_by_text("needs WebGL").wait_for(timeout=60_000)
    tab.get_by_role("button", name="Settings").click()
    tab.get_by_label("Covariances").check()
    wait_in(tab, lambda: page._server.space.scene.appearance.covariances)
    tab.get_by_role("button", name="Topics", exact=True).click()
    tab.get_by_role("table", name="Topics").wait_for(timeout=60_000)


def test_a_viewer_turns_its_view_and_sets_nothing(visit, runtime, page):
    publish(runtime)
    tab = visit(address=page.url.rpartition("/")[0] + f"/{VIEW_TOKEN}")
    wait_in(tab, lambda: reds(tab))
    tab.get_by_role("button", name="Settings").click()
    assert tab.get_by_label("Covariances").is_disabled()
    assert tab.get_by_label("Fixed frame").is_disabled()
    before = pixels(tab)
    tab.get_by_role("button", name="View from above").click()
    wait_in(tab, lambda: np.abs(pixels(tab) - before).mean() > 1)
    assert "goal" not in tab.get_by_label("Click").inner_text()


def test_a_finger_turns_the_view_on_a_phone(visit, runtime):
    publish(runtime)
    phone = {"viewport": {"width": 390, "height": 700}, "has_touch": True, "is_mobile": True}
    tab = visit(**phone)
    wait_in(tab, lambda: reds(tab))
    box = canvas(tab).bounding_box()
    assert box["width"] >= 380
    before = pixels(tab)
    with closing_session(tab) as touch:
        x, y = box["x"] + 200, box["y"] + 200
        points = [{"x": x, "y": y}]
        touch.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": points})
        for step in range(1, 6):
            points = [{"x": x + 20 * step, "y": y}]
            touch.send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": points})
        touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    wait_in(tab, lambda: np.abs(pixels(tab) - before).mean() > 1)


def closing_session(tab):
    session = tab.context.new_cdp_session(tab)
    session.close = session.detach
    return closing(session)
