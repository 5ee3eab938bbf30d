"""The page on a phone: an image and what belongs to it are there without a tap."""

from itertools import pairwise

import pytest

from ros_visualise.ui.shell import VISER

PHONES = [(400, 800), (390, 844)]
BOXES = """() => {
    const box = (element) => {
        const { left, top, right, bottom } = element.getBoundingClientRect();
        return { left, top, right, bottom };
    };
    const named = (text) => [...document.querySelectorAll("label")].find(
        (label) => label.textContent.trim() === text);
    const image = document.querySelector("[data-images] canvas");
    const caption = document.querySelector(".rv-caption:has(.rv-whole)");
    const there = [named("Playback"), named("Time"), named("FPS"), image, caption];
    return there.every(Boolean) ? there.map(box) : null;
}"""


def fit(boxes, width, height):
    """Whether they are one below the other, all on the screen, with the image as wide as that."""
    image = boxes[3]
    in_order = all(above["bottom"] <= below["top"] + 1 for above, below in pairwise(boxes))
    is_wide = image["right"] - image["left"] > 0.9 * width and image["bottom"] - image["top"] > 200
    return in_order and is_wide and boxes[-1]["bottom"] <= height


@pytest.mark.parametrize("size", PHONES)
def test_an_image_and_its_sliders_fit(chromium, page, size):
    width, height = size
    context = chromium.new_context(
        viewport={"width": width, "height": height}, has_touch=True, is_mobile=True
    )
    tab = context.new_page()
    tab.goto(page.url + VISER, timeout=90_000)
    for _ in range(900):
        boxes = tab.evaluate(BOXES)
        if boxes and fit(boxes, width, height):
            break
        tab.wait_for_timeout(100)  # windows unfold
    assert fit(boxes, width, height), boxes
    assert tab.evaluate("document.documentElement.scrollWidth") <= width
    context.close()
