"""The map: the track of a film's GPS, and the way from a place to its time."""

import sqlite3
import subprocess
import sys

import cv2
import forked
import numpy as np
from page_client import TOKEN, ClockClient, wait_in

MAP = "?layout={~tabs~:[{~panel~:~map~},{~panel~:~log~}],~shown~:1}"  # hidden at first


PLACES = """
import json
from ros_visualise.data import Image, Text
from ros_visualise.nodes import node

DATA = "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAQAAAC1HAwCAAAAC0lEQVR42mNk+A8AAQUBAScY42YAAAAASUVORK5C"
DATA += "YII="

def square(south, **properties):
    north, west, east = south + 1e-4, -117.3312, -117.3311
    ring = [[west, south], [east, south], [east, north], [west, north], [west, south]]
    geometry = {"type": "Polygon", "coordinates": [ring]}
    return {"type": "Feature", "properties": properties, "geometry": geometry}

@node("places", inputs={"image": Image}, outputs={"own": Text}, topics={"own": "/own/geojson"})
def places(image, params):
    'Places two squares, one with a picture.'
    picture = f"data:image/png;base64,{DATA}"
    features = [square(33.1255, name="<b>yard</b>"), square(33.1257, image=picture)]
    return Text(json.dumps({"type": "FeatureCollection", "features": features}), image.header)
"""


def make_tiles(path):
    """A file with one tile, of the whole world."""
    tile = cv2.imencode(".png", np.zeros((256, 256, 3), np.uint8))[1].tobytes()
    with sqlite3.connect(path) as file:
        file.execute("CREATE TABLE metadata (name TEXT, value TEXT)")
        file.execute("CREATE TABLE tiles (zoom_level, tile_column, tile_row, tile_data BLOB)")
        file.execute("INSERT INTO tiles VALUES (0, 0, 0, ?)", (tile,))
    file.close()
    return str(path)


def is_fitted(box):
    """Whether a track of 67 m to the north and 36 m to the west has the shape and the room."""
    return box["height"] > 100 and 1.5 < box["height"] / box["width"] < 2.2


def test_track_places_and_tiles_are_shown_and_a_click_goes_to_a_time(
    chromium, recordings, port, tmp_path
):
    film, own = recordings / "video" / "gopro_karma_drone.mp4", tmp_path / "own.py"
    own.write_text(PLACES)
    shown = [sys.executable, "-m", "ros_visualise", str(film), "--port", str(port), "--no-open"]
    shown += ["--node", f"{own}:places", "--tiles", make_tiles(tmp_path / "world.mbtiles")]
    with forked.Forked(shown, stderr=subprocess.PIPE, text=True) as process:
        assert any("open http" in line for line in process.stderr)
        context = chromium.new_context(viewport={"width": 800, "height": 600})
        tab = context.new_page()
        errors = []
        tab.on("pageerror", lambda error: errors.append(str(error)))
        tab.goto(f"http://127.0.0.1:{port}/{TOKEN}/{MAP}")
        tab.locator("path.leaflet-interactive").first.wait_for(state="attached", timeout=60_000)
        tab.get_by_role("tab", name="Map").click()
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
        tab.locator("img.leaflet-image-layer").wait_for(timeout=60_000)
        tab.locator("path.leaflet-interactive:not([fill=none])[stroke-width='2']").hover(force=True)
        tip = tab.locator(".leaflet-tooltip", has_text="yard").first  # another may still fade
        assert tip.inner_text() == "<b>yard</b>"
        tab.locator("img.leaflet-tile[src*='/tiles/']").first.wait_for(state="attached")
        kind = "fetch(rv.root + '/tiles/0/0/0').then((tile) => tile.headers.get('content-type'))"
        assert tab.evaluate(kind) == "image/png"
        assert not errors
        context.close()
        process.terminate()
        process.communicate()


def test_without_fixes_it_says_so(browse):
    tab = browse("?layout={~panel~:~map~}", images=False)
    tab.get_by_text("No topics with satellite positions (NavSatFix) or GeoJSON").wait_for(
        timeout=60_000
    )
