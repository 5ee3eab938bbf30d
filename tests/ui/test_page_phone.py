"""The page on a phone and an upright tablet: a panel and the timeline are there without a tap."""

import pytest
from page_client import wait_in

SIZES = [(390, 844), (820, 1180)]


@pytest.mark.parametrize("size", SIZES)
def test_an_image_and_the_timeline_fit(chromium, page, size):
    width, height = size
    context = chromium.new_context(
        viewport={"width": width, "height": height}, has_touch=True, is_mobile=True
    )
    tab = context.new_page()
    tab.goto(f"{page.url}/?layout={{~panel~:~image~}}", timeout=90_000)
    tab.locator("[data-images]").wait_for(timeout=120_000)
    bar = tab.get_by_role("slider", name="Time").bounding_box()
    image = tab.get_by_role("img", name="/controlled_stream").bounding_box()
    assert image["width"] > 0.9 * width
    assert image["height"] > 200
    assert image["y"] + image["height"] <= bar["y"]
    assert bar["width"] > 0.9 * width
    assert tab.evaluate("document.documentElement.scrollWidth") <= width
    for name in ("Search the page", "Undo", "Redo", "Layouts"):  # however many panels there are
        button = tab.get_by_role("button", name=name).bounding_box()
        assert 0 <= button["x"] <= width - button["width"]
    tab.get_by_role("button", name="Panels").tap()
    offered = tab.get_by_role("menu").get_by_role("listitem")
    assert offered.count() >= 17
    offered.filter(has_text="Topics").tap()
    topics = tab.get_by_role("tab", name="Topics")
    wait_in(tab, lambda: topics.count() and 0 <= topics.bounding_box()["y"] < bar["y"] - 200)
    context.close()
