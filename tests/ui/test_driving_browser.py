"""Driving in a real browser: a robot moves while a button or a key is held, and no longer."""

import pytest
from page_client import wait_in
from test_driving import Told, graph_of

from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.playback import Playback
from ros_visualise.ui import ViewOptions
from ros_visualise.ui.page import Page, robot
from ros_visualise.ui.shell import VISER

STOP = (0.0, 0.0, 0.0)


@pytest.fixture
def husky(port):
    running = LocalRuntime(graph_of("husky"), Playback(hold=True))
    told = Told(running)
    page = Page(ViewOptions(port=port, title="husky <1>"))
    page.open(told)
    told.url = page.url
    yield told
    page.close()


@pytest.fixture
def tab(chromium, husky):
    context = chromium.new_context(viewport={"width": 1280, "height": 720})
    tab = context.new_page()
    tab.goto(husky.url + VISER)
    tab.wait_for_selector("[data-hold=forward]")
    yield tab
    context.close()


def is_driven(husky, velocity):
    return husky.velocities[-3:] == [velocity] * 3


def is_stopped(husky):
    return husky.velocities[-1] == STOP


def test_it_moves_while_a_button_or_key_is_held(tab, husky, monkeypatch):
    monkeypatch.setattr(robot, "_LAPSE_S", 20)  # a machine may be busy
    file = tab.locator("xpath=//label[.='File']/ancestor::div[.//input][1]//input").first
    file.click()
    tab.keyboard.type("limit")  # is no driving
    assert file.input_value().count("limit") == 1
    assert not husky.velocities

    tab.hover("[data-hold=forward]")
    tab.mouse.down()
    wait_in(tab, lambda: is_driven(husky, (0.8, 0.0, 0.0)))
    tab.mouse.move(900, 300)
    tab.mouse.up()
    wait_in(tab, lambda: is_stopped(husky))

    tab.keyboard.down("i")
    tab.keyboard.down("j")
    wait_in(tab, lambda: is_driven(husky, (0.8, 0.0, 0.6)))
    tab.keyboard.up("i")
    wait_in(tab, lambda: is_driven(husky, (0.0, 0.0, 0.6)))
    tab.keyboard.press("k")
    wait_in(tab, lambda: is_stopped(husky))
    sent = len(husky.velocities)
    tab.wait_for_timeout(500)
    assert len(husky.velocities) == sent, "stopped is stopped, though a key is still down"
    tab.keyboard.up("j")

    for event in ("blur", "pagehide"):
        tab.keyboard.down("m")
        wait_in(tab, lambda: is_driven(husky, (-0.8, 0.0, 0.0)))
        tab.evaluate(f"window.dispatchEvent(new Event('{event}'))")
        wait_in(tab, lambda: is_stopped(husky))
        tab.keyboard.up("m")


def test_it_stops_when_the_connection_is_lost(tab, husky):
    tab.keyboard.down("l")
    wait_in(tab, lambda: husky.velocities)
    tab.evaluate("rv.send = () => {}")
    wait_in(tab, lambda: is_stopped(husky))
    assert set(husky.velocities[:-1]) == {(0.0, 0.0, -0.6)}
