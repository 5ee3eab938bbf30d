"""A click on a picture of a lesson, in a real browser, chooses the pixel that is seen there."""

import numpy as np
import pytest

from ros_visualise.data import Image
from ros_visualise.graph import Graph, place
from ros_visualise.lessons.lesson import GIVES, TAKES
from ros_visualise.lessons.magnifier import PixelParams
from ros_visualise.nodes import node
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.ui.shell import VISER

WIDE, HIGH = 240, 500  # higher than there is room for, so that it is narrower than its window


@node("looked_at", params=PixelParams, inputs=TAKES, outputs={"image": GIVES["image"]})
def looked_at(image, params):
    """An image of which one chooses a pixel."""
    return image


@pytest.fixture
def runtime():
    declared = looked_at.declared
    shown = place(declared, {"image": "/image_raw"}, {"image": "/looked_at"})
    running = LocalRuntime(Graph(None, (shown,)), None)
    running.start()
    running.publish("/image_raw", Image(np.zeros((HIGH, WIDE), np.uint8), "mono8"))
    yield running
    running.stop()


def test_a_click_chooses_the_pixel_under_it(chromium, page, runtime):
    context = chromium.new_context(viewport={"width": 1280, "height": 720})
    tab = context.new_page()
    tab.goto(page.url + VISER)
    tab.wait_for_selector("text=240 × 500", timeout=60_000)
    box = tab.locator("[data-images] canvas").bounding_box()
    scale = min(box["width"] / WIDE, box["height"] / HIGH)
    left = box["x"] + (box["width"] - scale * WIDE) / 2
    assert left > box["x"] + 5
    for x, y in [(10, 20), (200, 450)]:
        tab.mouse.click(left + scale * (x + 0.5), box["y"] + scale * (y + 0.5))
        chosen = runtime.parameters["looked_at"]
        for _ in range(300):
            if chosen.current.x >= 0 and abs(chosen.current.y - y) < 5:
                break
            tab.wait_for_timeout(100)
        assert (chosen.current.x, chosen.current.y) == pytest.approx((x, y), abs=2 / scale)
    context.close()
