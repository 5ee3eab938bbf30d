"""A click on a picture of a lesson, in a real browser, chooses the pixel that is seen there."""

import numpy as np
import pytest
from page_client import VIEW_TOKEN, ImageClient, wait_in
from waiting import wait_for

from ros_visualise.data import Image
from ros_visualise.graph import Graph, place
from ros_visualise.lessons.lesson import GIVES, TAKES
from ros_visualise.lessons.magnifier import PixelParams
from ros_visualise.nodes import node
from ros_visualise.runtime.local import LocalRuntime

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
    tab.goto(f"{page.url}/?layout={{~panel~:~image~}}")
    tab.get_by_text("240 × 500").wait_for(timeout=60_000)
    box = tab.get_by_role("img", name="/looked_at").bounding_box()
    scale = min(box["width"] / WIDE, box["height"] / HIGH)
    left = box["x"] + (box["width"] - scale * WIDE) / 2
    assert left > box["x"] + 5
    chosen = runtime.parameters["looked_at"]
    for x, y in [(10, 20), (200, 450)]:
        tab.mouse.click(left + scale * (x + 0.5), box["y"] + scale * (y + 0.5))
        wait_in(tab, lambda y=y: chosen.current.x >= 0 and abs(chosen.current.y - y) < 5)
        assert (chosen.current.x, chosen.current.y) == pytest.approx((x, y), abs=2 / scale)
    context.close()


def test_who_may_only_look_chooses_none(page, port, runtime):
    viewer, other = ImageClient(port, f"/{VIEW_TOKEN}"), ImageClient(port)
    for client in (viewer, other):
        client.show("/looked_at")
        client.read_until(lambda client=client: client.images)
    assert "read-only" in viewer.ask("/looked_at", "pick", 0.5, 0.5)[0]["problem"]
    for nothing in (None, "x", {}):
        viewer.send(ask=nothing, key="/looked_at", what="pick", at=[0.5, 0.5])
    other.ask("/looked_at", "pick", 0.1, 0.1)
    wait_for(lambda: runtime.parameters["looked_at"].current.x == 24)
    for client in (viewer, other):
        client.socket.close()
