"""Windows on a real screen (Xvfb): each test is a process of its own, as Qt wants it."""

import os
import shutil
import signal
import subprocess
import sys
import textwrap
import time

import pytest
from waiting import wait_for

HELPERS = """
import os, subprocess, sys, time
import cv2, numpy as np
from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.playback import Playback
from ros_visualise.ui.windows import Windows

def spin_until(condition, what):
    end = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < end, what
        view.spin(0.03)

def xdo(*words):
    subprocess.run(["xdotool", *map(str, words)], check=True, stdout=subprocess.DEVNULL)

def focus(title):
    found = ["xdotool", "search", "--name", f"^{title}$"]
    window = subprocess.run(found, capture_output=True, text=True).stdout.split()[-1]
    xdo("windowfocus", "--sync", window)

def bar(pane, name):
    scales = next(p for p in view._panes if p.name == pane).trackbars.names
    return next((shown, pane) for scale, shown in scales.items() if scale.spec.name == name)

view = Windows()
graph = image_pipeline("landscape", size="160x120").configured({"filters": {"threshold": 128}})
runtime = LocalRuntime(graph, Playback(hold=True))
runtime.start()
view.open(runtime)
seen = runtime.subscribe("/processed_image")
spin_until(lambda: seen.take(0) is not None, "no image came")
filters = runtime.parameters["filters"]
try:
    exec(sys.stdin.read())
finally:
    view.close()
    runtime.stop()
"""


@pytest.fixture(scope="module")
def screen():
    """The number of a virtual screen, as DISPLAY wants it."""
    read, write = os.pipe()
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", "1920x1080x24", "-nolisten", "tcp"]
    command += ["-noreset"]  # else it turns clients away just after the last one has gone
    server = subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    with os.fdopen(read) as display:
        number = display.readline().strip()
    yield f":{number}"
    server.terminate()
    server.wait()


@pytest.fixture(scope="module", autouse=True)
def _needs_windows():
    import cv2

    if shutil.which("Xvfb") is None or "GUI:                           NONE" in (
        cv2.getBuildInformation()
    ):
        if os.environ.get("CI"):
            pytest.fail("install xvfb and the extra `desktop`")
        pytest.skip("needs xvfb and an OpenCV with windows: pip install '.[desktop]'")


@pytest.fixture
def on_screen(screen):
    """Runs code with windows open on the demo."""

    def run(code):
        done = subprocess.run(
            [sys.executable, "-c", HELPERS],
            input=textwrap.dedent(code),
            capture_output=True,
            text=True,
            timeout=60,
            env={**os.environ, "DISPLAY": screen},
        )
        assert done.returncode == 0, done.stderr
        assert "Traceback" not in done.stderr

    return run


def test_a_trackbar_dragged_with_the_mouse_changes_the_published_pixels(on_screen):
    on_screen(
        """
        before = filters.current.threshold
        x = next(p for p in view._panes if p.name == "filters")._box.x
        rows = list(filters.current.__dataclass_fields__)
        y = 64 + 25 * rows.index("threshold") + 10
        view.spin(0.3)
        xdo("mousemove", x + 380, y, "click", 1)
        spin_until(lambda: filters.current.threshold > before, "the trackbar did not move")
        level = filters.current.threshold
        spin_until(lambda: (i := seen.take(0)) is not None and i.pixels.max() > before, "no effect")
        assert cv2.getTrackbarPos(*bar("filters", "threshold")) == level
        """
    )


def test_trackbars_set_every_kind_of_parameter(on_screen):
    on_screen(
        """
        for name, position, value in [
            ("threshold", 40, 40), ("gray", 0, False), ("contrast", 75, 1.5),
            ("brightness", 200, -55), ("scale", 40, 0.5),
        ]:
            cv2.setTrackbarPos(*bar("filters", name), position)
            spin_until(lambda: getattr(filters.current, name) == value, name)
        cv2.setTrackbarPos(*bar("filters", "blur"), 2)
        spin_until(lambda: filters.current.blur.value == "median", "blur")
        shape = (60, 80, 3)
        spin_until(lambda: (i := seen.take(0)) is not None and i.pixels.shape == shape, "size")
        """
    )


def test_what_changes_elsewhere_moves_the_trackbar_and_keeps_its_exact_value(on_screen):
    on_screen(
        """
        filters.update({"threshold": 77, "contrast": 1.2345, "blur": "gaussian", "scale": 4})
        wanted = {"threshold": 77, "contrast": 62, "blur": 1, "scale": 190}
        spin_until(lambda: all(
            cv2.getTrackbarPos(*bar("filters", n)) == p for n, p in wanted.items()), "not moved")
        view.spin(0.2)
        assert (filters.current.contrast, filters.current.scale) == (1.2345, 4.0)
        """
    )


def test_a_refused_value_snaps_back(on_screen):
    on_screen(
        """
        from ros_visualise.core.errors import ParameterError
        def refuse(changes):
            refused.append(changes)
            raise ParameterError("not this one")
        refused = []
        filters.update = refuse
        cv2.setTrackbarPos(*bar("filters", "threshold"), 9)
        spin_until(lambda: refused, "never asked")
        spin_until(lambda: cv2.getTrackbarPos(*bar("filters", "threshold")) == 128, "no way back")
        assert refused == [{"threshold": 9}]
        """
    )


def test_keys_pause_step_and_quit(on_screen):
    on_screen(
        """
        focus("/edges")
        xdo("key", "space")
        spin_until(lambda: not runtime.playback.state.playing, "no pause")
        at = runtime.playback.state.position_s
        for key, sign in [("period", 1), ("comma", -1), ("Right", 1), ("Left", -1)]:
            xdo("key", key)
            spin_until(lambda: (runtime.playback.state.position_s - at) * sign > 0, key)
            at = runtime.playback.state.position_s
        xdo("key", "space")
        spin_until(lambda: runtime.playback.state.playing, "does not go on")
        assert not view.closed
        xdo("key", "q")
        spin_until(lambda: view.closed, "no end")
        """
    )


def test_a_closed_window_stays_closed_and_the_last_one_ends_the_view(on_screen):
    on_screen(
        """
        topics = ["/image_raw", "/controlled_stream", "/processed_image", "/edges"]
        assert [p.name for p in view._panes] == [*topics, "filters"]
        cv2.destroyWindow("/edges")
        view.spin(0.3)
        assert cv2.getWindowProperty("/edges", cv2.WND_PROP_VISIBLE) < 1
        assert [p.name for p in view._panes] == [*topics[:3], "filters"]
        for topic in topics[:3]:
            assert not view.closed
            cv2.destroyWindow(topic)
            view.spin(0.1)
        assert view.closed
        """
    )


def test_quitting_ends_the_command_with_status_0(screen):
    process = subprocess.Popen(
        [sys.executable, "-m", "ros_visualise", "demo", "landscape", "--view", "windows"],
        env={**os.environ, "DISPLAY": screen},
        stderr=subprocess.PIPE,
        text=True,
    )
    xdo = {"env": {**os.environ, "DISPLAY": screen}, "timeout": 20}
    find = ["xdotool", "search", "--onlyvisible", "--name", "^filters$"]

    def shown():  # nothing, too, if another window goes meanwhile
        return subprocess.run(find, **xdo, capture_output=True, text=True).stdout.split()

    try:
        windows = wait_for(shown, "a window", process=process)
        press = ["xdotool", "windowfocus", "--sync", windows[-1], "key", "Escape"]
        subprocess.run(press, **xdo, check=True)
        _, errors = process.communicate(timeout=20)
    finally:
        process.kill()
        print(process.communicate()[1])
    assert process.returncode == 0
    assert "Traceback" not in errors


def test_ctrl_c_while_windows_are_tried_is_not_taken_for_windows_that_do_not_start(screen):
    code = """if True:
        import signal
        from ros_visualise.ui.screen import check_windows
        signal.signal(signal.SIGINT, lambda *_: None)
        print("trying", flush=True)
        check_windows()"""
    process = subprocess.Popen(
        [sys.executable, "-c", code],
        env={**os.environ, "DISPLAY": screen},
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    assert process.stdout.readline() == "trying\n"
    time.sleep(0.1)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal tells the whole group
    errors = process.communicate(timeout=60)[1]
    assert process.returncode == 0, errors


@pytest.mark.parametrize("display", ["", ":99999"])
def test_without_a_screen_one_line_says_so(display):
    env = {k: v for k, v in os.environ.items() if k != "WAYLAND_DISPLAY"}
    done = subprocess.run(
        [sys.executable, "-m", "ros_visualise", "demo", "landscape", "--view", "windows"],
        env={**env, "DISPLAY": display},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 2
    [line] = done.stderr.splitlines()
    assert "view web" in line
    assert "DISPLAY" in line
