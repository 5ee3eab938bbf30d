"""Image panels in a real browser: zoomed, compared, with their values, kept in the address."""

import re

import cv2
import numpy as np
import pytest
from page_client import wait_in

BRIGHT = """canvas => {
    const copy = document.createElement('canvas');
    [copy.width, copy.height] = [canvas.width, canvas.height];
    const context = copy.getContext('2d');
    context.drawImage(canvas, 0, 0);
    return ([x, y]) => Array.from(context.getImageData(x, y, 1, 1).data);
}"""


def image(tab, topic="/controlled_stream"):
    return tab.get_by_role("img", name=topic)


def seen(tab, x, y, topic="/controlled_stream"):
    """The colour of a canvas at fractions of its width and height: red, green, blue, alpha."""
    script = f"canvas => ({BRIGHT})(canvas)([canvas.width * {x} | 0, canvas.height * {y} | 0])"
    return image(tab, topic).evaluate(script)


def value(tab):
    return tab.locator(".rv-image-value").inner_text()


@pytest.fixture
def pixels(runtime):
    """The images of the demo, as they came."""
    found = {}
    for topic in ("/controlled_stream", "/processed_image", "/edges"):
        subscription = runtime.subscribe(topic)
        found[topic] = subscription.take(30).pixels
        subscription.close()
    return found


def open_images(browse, layout):
    tab = browse(f"?layout={layout}", images=False)
    tab.locator("[data-images]").first.wait_for(timeout=120_000)
    return tab


def test_a_wheel_enlarges_what_is_under_the_pointer_and_the_address_keeps_it(browse, pixels):
    tab = open_images(browse, "{~panel~:~image~,~state~:{~topic~:~/controlled_stream~}}")
    facts = tab.get_by_text("640 × 480 bgr8, 0:00.00", exact=True)
    facts.wait_for(timeout=60_000)
    assert re.fullmatch(r"Stamp \d{19} ns", facts.get_attribute("title"))
    box = image(tab).bounding_box()
    at = box["x"] + box["width"] / 2 + 60, box["y"] + box["height"] / 2 - 40
    tab.mouse.move(*at)
    wait_in(tab, lambda: re.match(r"x \d+, y \d+: B \d+", value(tab)))
    before = re.match(r"x (\d+), y (\d+)", value(tab)).groups()
    for _ in range(40):
        tab.mouse.wheel(0, -100)
    wait_in(tab, lambda: "~zoom~" in tab.url)
    x, y = map(int, before)
    wait_in(tab, lambda: value(tab).startswith(f"x {x}, y {y}:"))
    blue, green, red = pixels["/controlled_stream"][y, x].tolist()
    wait_in(tab, lambda: value(tab) == f"x {x}, y {y}: B {blue} G {green} R {red}")
    where = (at[0] - box["x"]) / box["width"], (at[1] - box["y"]) / box["height"]
    colour = lambda: np.abs(np.subtract(seen(tab, *where)[:3], (red, green, blue))).max()  # noqa: E731
    wait_in(tab, lambda: colour() < 12)

    tab.reload()
    tab.locator("[data-images]").wait_for(timeout=60_000)
    wait_in(tab, lambda: colour() < 12)
    tab.locator(".rv-image-over").dblclick()
    wait_in(tab, lambda: "zoom" not in tab.url and seen(tab, 0.5, 0.001)[3] in (0, 255))
    tab.locator(".rv-image-over").press("+")
    wait_in(tab, lambda: "~zoom~:[1.25," in tab.url)
    tab.locator(".rv-image-over").press("0")
    wait_in(tab, lambda: "zoom" not in tab.url)


def test_two_topics_stand_side_by_side_under_a_wipe_or_subtracted(browse, pixels):
    two = "~topic~:~/controlled_stream~,~others~:[~/processed_image~]"
    tab = open_images(browse, f"{{~panel~:~image~,~state~:{{{two}}}}}")
    both = "/controlled_stream, /processed_image"
    is_gray = lambda x: np.ptp(seen(tab, x, 0.5, both)[:3]) < 3 and seen(tab, x, 0.5, both)[3]  # noqa: E731
    wait_in(tab, lambda: is_gray(0.75) and not is_gray(0.25))
    tab.get_by_label("Comparison").select_option("Wipe")
    wait_in(tab, lambda: is_gray(0.55) and not is_gray(0.45))
    box = image(tab, both).bounding_box()
    middle = box["y"] + box["height"] / 2
    tab.mouse.move(box["x"] + box["width"] / 2, middle)
    tab.mouse.down()
    tab.mouse.move(box["x"] + box["width"] * 0.4, middle, steps=4)
    tab.mouse.up()
    wait_in(tab, lambda: is_gray(0.45) and not is_gray(0.35))
    wait_in(tab, lambda: re.search(r"/controlled_stream B.*; /processed_image \d+$", value(tab)))

    tab.get_by_label("Comparison").select_option("Difference")
    tab.mouse.move(box["x"] + box["width"] / 2 + 30, middle)
    wait_in(tab, lambda: "/processed" not in value(tab) and value(tab).startswith("x "))
    x, y = map(int, re.match(r"x (\d+), y (\d+)", value(tab)).groups())
    gray = cv2.cvtColor(pixels["/processed_image"], cv2.COLOR_GRAY2BGR)
    apart = cv2.absdiff(pixels["/controlled_stream"], gray)[y, x].tolist()
    wait_in(tab, lambda: [int(v) for v in re.findall(r"[BGR] (\d+)", value(tab))] == apart)
    wait_in(tab, lambda: "~mode~:~difference~" in tab.url)


def test_a_dropped_topic_is_shown_and_what_is_not_there_is_said(browse, runtime):
    tab = open_images(browse, "{~panel~:~image~}")
    drop = """(panel, topic) => {
        const dataTransfer = new DataTransfer();
        dataTransfer.setData("text/rv-topic", topic);
        panel.dispatchEvent(new DragEvent("drop", { dataTransfer, bubbles: true }));
    }"""
    panel = tab.locator(".rv-image")
    panel.evaluate(drop, "/no/such")
    panel.evaluate(drop, "/edges_overlay")  # made on demand
    image(tab, "/edges_overlay").wait_for()
    wait_in(tab, lambda: "/edges_overlay" in runtime.report().topics)
    wait_in(tab, lambda: "~topic~:~/edges_overlay~" in tab.url)
    tab.get_by_label("Options").click()
    tab.get_by_label("Compare with").select_option("/edges")
    image(tab, "/edges_overlay, /edges").wait_for()
    gone = open_images_of(browse, "/gone")
    gone.get_by_text("/gone is not in this graph").wait_for(timeout=60_000)


def open_images_of(browse, topic):
    return browse(f"?layout={{~panel~:~image~,~state~:{{~topic~:~{topic}~}}}}", images=False)


def test_images_of_a_tab_that_is_not_shown_are_not_made(browse, runtime):
    tabs = "{~tabs~:[{~panel~:~image~,~state~:{~topic~:~/edges_overlay~}},{~panel~:~topics~}]"
    tab = browse(f"?layout={tabs},~shown~:1}}", images=False)
    tab.get_by_role("table", name="Topics").wait_for(timeout=60_000)
    shown = browse("?layout={~panel~:~image~,~state~:{~topic~:~/edges~}}", images=False)
    shown.locator("[data-images]").wait_for(timeout=60_000)
    assert "/edges_overlay" not in runtime.report().topics
    tab.get_by_role("tab", name="/edges_overlay").click()
    wait_in(tab, lambda: tab.locator("[data-images]").count() == 1)
    assert "/edges_overlay" in runtime.report().topics


def test_the_values_are_saved_counted_and_drawn_along_a_line(browse, pixels, tmp_path):
    tab = open_images_of(browse, "/edges")
    tab.get_by_text("640 × 480 mono8").wait_for(timeout=60_000)
    with tab.expect_download() as saved:
        tab.get_by_role("button", name="Save PNG").click()
    saved.value.save_as(tmp_path / "edges.png")
    read = cv2.imread(str(tmp_path / "edges.png"), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(read, pixels["/edges"])
    tab.get_by_role("button", name="Histogram").click()
    tab.get_by_text("0 to 255").wait_for()
    tab.get_by_role("button", name="Line profile").click()
    box = image(tab, "/edges").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    tab.mouse.move(x, y)
    tab.mouse.down()
    tab.mouse.move(x + 80, y, steps=4)
    tab.mouse.up()
    tab.get_by_text(re.compile(r"^\d+\.\d pixels, \d+ to \d+$")).wait_for()
