"""The map: the track of a film's GPS, and the way from a place to its time."""

import subprocess
import sys

from page_client import TOKEN, ClockClient, wait_in

MAP = "?layout={~panel~:~map~}"


def is_fitted(box):
    """Whether a track of 67 m to the north and 36 m to the west has the shape and the room."""
    return box["height"] > 100 and 1.5 < box["height"] / box["width"] < 2.2


def test_the_track_is_shown_and_a_click_goes_to_its_time(chromium, recordings, port):
    film = recordings / "video" / "gopro_karma_drone.mp4"
    shown = [sys.executable, "-m", "ros_visualise", str(film), "--port", str(port), "--no-open"]
    with subprocess.Popen(shown, stderr=subprocess.PIPE, text=True) as process:
        assert any("open http" in line for line in process.stderr)
        context = chromium.new_context(viewport={"width": 800, "height": 600})
        tab = context.new_page()
        tab.goto(f"http://127.0.0.1:{port}/{TOKEN}/{MAP}")
        track = tab.locator("path.leaflet-interactive[fill=none]").first  # not the place
        track.wait_for(timeout=60_000)
        wait_in(tab, lambda: tab.locator(".leaflet-control-scale-line").inner_text() == "10 m")
        wait_in(tab, lambda: is_fitted(track.bounding_box()))
        box = track.bounding_box()
        with ClockClient(port, TOKEN) as clock:
            clock.act(toggle=1)
            at = {"x": box["width"] / 2, "y": box["height"] / 2}
            track.click(position=at, force=True)
            clock.read_until(lambda state: 4 < (state.get("position") or 0) < 9)
        context.close()
        process.terminate()
        process.communicate()


def test_without_fixes_it_says_so(browse):
    tab = browse(MAP, images=False)
    tab.get_by_text("No topics with satellite positions").wait_for(timeout=60_000)
