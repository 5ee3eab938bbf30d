"""Driving in a real browser: a robot moves while a button or a key is held, and no longer."""

import pytest
from page_client import wait_in
from test_live_robot import Told, graph_of
from waiting import wait_for

from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.playback import Playback
from ros_visualise.ui import ViewOptions
from ros_visualise.ui.live import robot
from ros_visualise.ui.page import Page

STOP = (0.0, 0.0, 0.0)


@pytest.fixture
def husky(port):
    running = LocalRuntime(graph_of("husky"), Playback(hold=True))
    told = Told(running)
    page = Page(ViewOptions(port=port, title="husky <1>"))
    page.open(told)
    told.url, told.view_url = page.url, page.view_url
    yield told
    page.close()


@pytest.fixture
def tab(chromium, husky):
    context = chromium.new_context(viewport={"width": 1280, "height": 720})
    tab = context.new_page()
    tab.goto(husky.url + "?layout={~row~:[{~panel~:~robot~},{~panel~:~files~}]}")
    tab.wait_for_selector("[data-hold=forward]")
    yield tab
    context.close()


def is_driven(husky, velocity):
    return husky.velocities[-3:] == [velocity] * 3


def is_stopped(husky):
    return husky.velocities[-1] == STOP


def test_it_moves_while_a_button_or_key_is_held(tab, husky, monkeypatch):
    monkeypatch.setattr(robot, "_LAPSE_S", 20)  # a machine may be busy
    file = tab.get_by_label("File", exact=True)
    file.click()
    tab.keyboard.type("limit")  # is no driving
    assert file.input_value().count("limit") == 1
    assert not husky.velocities

    tab.hover("[data-hold=forward]")
    tab.mouse.down()
    wait_in(tab, lambda: is_driven(husky, (0.8, 0.0, 0.0)))
    tab.mouse.move(900, 500)
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
    tab.evaluate("WebSocket.prototype.send = () => {}")
    wait_in(tab, lambda: is_stopped(husky))
    assert set(husky.velocities[:-1]) == {(0.0, 0.0, -0.6)}


def test_it_stops_when_the_panel_or_the_tab_is_closed(tab, husky, monkeypatch):
    monkeypatch.setattr(robot, "_LAPSE_S", 20)
    tab.keyboard.down("i")
    wait_in(tab, lambda: is_driven(husky, (0.8, 0.0, 0.0)))
    tab.get_by_role("button", name="Close Robot").click()
    wait_in(tab, lambda: is_stopped(husky))
    tab.keyboard.up("i")
    sent = len(husky.velocities)
    tab.keyboard.down("i")
    tab.wait_for_timeout(300)
    assert len(husky.velocities) == sent, "without its panel a robot is not driven"
    tab.keyboard.up("i")
    tab.get_by_role("button", name="Robot", exact=True).click()
    tab.wait_for_selector("[data-hold=forward]")
    tab.keyboard.down("i")
    wait_in(tab, lambda: is_driven(husky, (0.8, 0.0, 0.0)))
    tab.close()
    wait_for(lambda: is_stopped(husky))


def test_who_may_only_look_drives_nothing(chromium, husky):
    context = chromium.new_context()
    tab = context.new_page()
    tab.goto(husky.view_url + "?layout={~panel~:~robot~}")
    tab.wait_for_selector("[data-hold=forward]:disabled")
    assert tab.get_by_role("button", name="Stop").first.is_disabled()
    tab.keyboard.press("i")
    tab.wait_for_timeout(200)
    assert not husky.velocities
    context.close()


def test_behind_another_tab_it_drives_nothing_and_its_keys_are_free(tab, husky, monkeypatch):
    monkeypatch.setattr(robot, "_LAPSE_S", 20)
    tab.keyboard.down("m")
    wait_in(tab, lambda: is_driven(husky, (-0.8, 0.0, 0.0)))
    tab.keyboard.up("m")
    wait_in(tab, lambda: is_stopped(husky))
    assert tab.evaluate("rv.clock.state.marks ?? []") == []
    tabs = "{~tabs~:[{~panel~:~robot~},{~panel~:~files~}],~shown~:0}"
    tab.goto(husky.url + f"?layout={tabs}")
    tab.wait_for_selector("[data-hold=forward]")
    tab.keyboard.down("i")
    wait_in(tab, lambda: is_driven(husky, (0.8, 0.0, 0.0)))
    tab.get_by_role("tab", name="Files").click()
    wait_in(tab, lambda: is_stopped(husky))
    sent = len(husky.velocities)
    tab.keyboard.up("i")
    tab.keyboard.down("i")
    tab.wait_for_timeout(300)
    assert len(husky.velocities) == sent
    tab.keyboard.up("i")
