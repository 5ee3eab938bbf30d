"""The page on a phone: an image and what belongs to it are there without a tap."""

from itertools import pairwise

import pytest

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
    const there = [named("FPS"), image, caption];
    return there.every(Boolean) ? there.map(box) : null;
}"""


def fit(boxes, width, height):
    """Whether they are one below the other, all on the screen, with the image as wide as that."""
    image = boxes[1]
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
    tab.goto(page.url, timeout=90_000)
    tab.wait_for_selector("iframe")
    for _ in range(900):
        boxes = tab.frames[-1].evaluate(BOXES)
        bar = tab.get_by_role("slider", name="Time").bounding_box()
        if boxes and bar and fit(boxes, width, bar["y"]):
            break
        tab.wait_for_timeout(100)  # windows unfold
    assert fit(boxes, width, bar["y"]), boxes
    assert bar["width"] > 0.9 * width
    assert tab.evaluate("document.documentElement.scrollWidth") <= width
    context.close()
