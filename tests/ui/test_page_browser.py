"""The page in a real browser: what a person moves and sees."""

import pytest
from page_client import wait_in

BRIGHTEST = """image => {
    const canvas = document.createElement('canvas');
    canvas.width = 160; canvas.height = 120;
    const context = canvas.getContext('2d');
    context.drawImage(image, 0, 0, canvas.width, canvas.height);
    const pixels = context.getImageData(0, 0, canvas.width, canvas.height).data;
    let brightest = 0;
    for (let i = 0; i < pixels.length; i += 4) brightest = Math.max(brightest, pixels[i]);
    return brightest;
}"""
NEARLY = 8  # JPEG is not exact: 7 levels off with OpenCV 4.8


def image(tab, topic="/processed_image"):
    return tab.get_by_role("img", name=topic)


def slider(tab, label):
    return tab.get_by_role("slider", name=label, exact=True)


def slide(tab, label, fraction, mouse):
    """Drag a slider to this part of its way."""
    box = slider(tab, label).bounding_box()
    middle = box["y"] + box["height"] / 2
    mouse.move(box["x"] + box["width"] / 2, middle)
    mouse.down()
    mouse.move(box["x"] + box["width"] * fraction, middle, steps=5)
    mouse.up()


def value_of(tab, label):
    return float(slider(tab, label).input_value())


def is_brightest(tab, value):
    there = image(tab)
    return there.count() == 1 and abs(there.evaluate(BRIGHTEST) - value) <= NEARLY


def test_threshold_slider_changes_the_pixels_on_all_browsers(browse, runtime):
    first, second = browse(""), browse("")
    wait_in(first, lambda: is_brightest(first, 128))

    slide(first, "Threshold", 0.2, first.mouse)

    filters = runtime.parameters["filters"]
    wait_in(first, lambda: filters.current.threshold < 90)
    wait_in(first, lambda: value_of(first, "Threshold") == filters.current.threshold)
    threshold = filters.current.threshold
    for tab in (first, second):
        wait_in(tab, lambda tab=tab: value_of(tab, "Threshold") == threshold)
        wait_in(tab, lambda tab=tab: is_brightest(tab, threshold))


def test_arrow_keys_move_the_slider_that_has_the_focus(browse, runtime):
    tab, filters = browse(""), runtime.parameters["filters"]
    tab.get_by_role("slider", name="Threshold").focus()
    tab.keyboard.press("ArrowLeft")
    wait_in(tab, lambda: filters.current.threshold == 127)
    assert runtime.playback.state.position_s == 0


def test_changes_from_elsewhere_move_sliders_and_latecomers_see_them(browse, runtime):
    tab = browse("")
    runtime.parameters["filters"].update({"threshold": 77})
    wait_in(tab, lambda: value_of(tab, "Threshold") == 77)
    wait_in(tab, lambda: is_brightest(tab, 77))

    tab.reload()
    wait_in(tab, lambda: is_brightest(tab, 77))
    late = browse("")
    wait_in(late, lambda: is_brightest(late, 77))


def test_undo_before_the_server_has_answered_undoes_that_change(browse, runtime):
    tab, filters = browse(""), runtime.parameters["filters"]
    tab.evaluate("rv.nodes.set('filters', 'threshold', 50)")
    tab.wait_for_function("rv.past.done.length === 1", timeout=60_000)
    tab.evaluate("rv.nodes.set('filters', 'threshold', 99); rv.past.undo()")
    answered = "rv.nodes.sent.size === 0 && rv.past.undone.length === 1"
    tab.wait_for_function(answered, timeout=60_000)
    wait_in(tab, lambda: filters.current.threshold == 50)


BREAK = """() => {
    const { send } = WebSocket.prototype;
    WebSocket.prototype.send = function () { this.close(); };
    rv.nodes.set("filters", "threshold", 99);
    WebSocket.prototype.send = send;
    rv.past.undo();
}"""


UNDO_WITHOUT_CONNECTION = """() => {
    const { send } = rv.nodes.socket;
    rv.nodes.socket.send = () => false;
    rv.past.undo();
    rv.nodes.socket.send = send;
    return [rv.past.done.length, rv.past.undone.length];
}"""


def test_a_broken_connection_loses_no_step_of_undo(browse, runtime):
    tab, filters = browse("", images=False), runtime.parameters["filters"]
    tab.wait_for_function("window.rv?.nodes?.run", timeout=60_000)
    tab.evaluate("rv.nodes.set('filters', 'threshold', 50)")
    tab.wait_for_function("rv.past.done.length === 1", timeout=60_000)
    assert tab.evaluate(UNDO_WITHOUT_CONNECTION) == [1, 0]
    tab.evaluate(BREAK)
    tab.wait_for_function("rv.nodes.run === null", timeout=60_000)
    tab.wait_for_function("rv.nodes.run !== null", timeout=60_000)
    assert tab.evaluate("[rv.past.done.length, rv.past.waiting.length]") == [1, 0]
    assert filters.current.threshold == 50
    tab.evaluate("rv.past.undo()")
    wait_in(tab, lambda: filters.current.threshold == 128)


def test_buttons_and_keys_play(browse, runtime):
    tab, playback = browse(""), runtime.playback
    tab.get_by_role("button", name="Play").click()
    wait_in(tab, lambda: playback.state.playing)
    tab.get_by_role("button", name="Pause").click()
    wait_in(tab, lambda: not playback.state.playing)
    before_s = playback.state.position_s
    tab.get_by_role("button", name="Step forward").click()
    wait_in(tab, lambda: playback.state.position_s > before_s)
    stepped_s = playback.state.position_s
    tab.get_by_role("button", name="Step back").click()
    wait_in(tab, lambda: playback.state.position_s < stepped_s)
    tab.keyboard.press("Space")
    wait_in(tab, lambda: playback.state.playing)
    tab.keyboard.press("Space")
    wait_in(tab, lambda: not playback.state.playing)
    tab.keyboard.press("Home")
    wait_in(tab, lambda: playback.state.position_s == 0)
    tab.keyboard.press("ArrowRight")
    wait_in(tab, lambda: playback.state.position_s == pytest.approx(5, abs=0.1))
    tab.keyboard.press(".")
    wait_in(tab, lambda: playback.state.position_s > 5)
    twice = (
        "key => [1, 2].forEach(() => document.dispatchEvent(new KeyboardEvent('keydown', {key})))"
    )
    tab.evaluate(twice, ">")  # the page has not heard of the first one yet
    wait_in(tab, lambda: playback.state.rate == 4)


def test_the_bar_scrubs_and_browsers_stay_in_step(browse, runtime):
    first, second, playback = browse(""), browse(""), runtime.playback
    bar = first.get_by_role("slider", name="Time")
    box = bar.bounding_box()
    assert box["y"] + box["height"] == pytest.approx(719, abs=2)  # below all
    middle = box["y"] + box["height"] / 2
    first.mouse.move(box["x"] + box["width"] / 4, middle)
    first.mouse.down()
    wait_in(first, lambda: playback.state.position_s == pytest.approx(15, abs=1))
    first.mouse.move(box["x"] + box["width"] / 2, middle, steps=5)
    wait_in(first, lambda: playback.state.position_s == pytest.approx(30, abs=1))
    first.mouse.up()
    for tab in (first, second):
        clock = tab.locator(".rv-clock")
        wait_in(tab, lambda clock=clock: clock.inner_text().startswith(("0:29", "0:30")))
    assert first.locator(".rv-clock").inner_text().endswith("/ 1:00.00")
    first.get_by_label("Playback speed").select_option("2 ×")
    wait_in(first, lambda: playback.state.rate == 2)
    second.get_by_role("button", name="Loop").click()
    wait_in(second, lambda: playback.state.loop)
