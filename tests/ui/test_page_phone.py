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
    const image = document.querySelector("img[src^='blob:']");
    const caption = document.querySelector(".rv-caption:has(.rv-whole)");
    const there = [named("playback"), named("time"), named("fps"), image, caption];
    return there.every(Boolean) ? there.map(box) : null;
}"""


@pytest.mark.parametrize("size", PHONES)
def test_an_image_and_its_sliders_fit(chromium, page, size):
    width, height = size
    context = chromium.new_context(
        viewport={"width": width, "height": height}, has_touch=True, is_mobile=True
    )
    tab = context.new_page()
    tab.goto(page.url)
    tab.wait_for_function(
        f"(({BOXES})() ?? []).some((box) => box.bottom - box.top > 200)", timeout=90_000
    )
    boxes = tab.evaluate(BOXES)
    for above, below in pairwise(boxes):
        assert above["bottom"] <= below["top"] + 1
    assert boxes[-1]["bottom"] <= height
    image = boxes[3]
    assert image["right"] - image["left"] > 0.9 * width
    assert tab.evaluate("document.documentElement.scrollWidth") <= width
    context.close()
