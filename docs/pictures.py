"""Makes the pictures of the documentation anew: ``python docs/pictures.py [NAME ...]``.

It runs what the pages describe, in a folder of its own, and keeps an image of each. NAME is a
picture without its suffix, such as ``examples/06_share_of_a_colour``. It takes a browser
(chromium), and for some pictures the recordings in the folder that ROS_VISUALISE_DATA names.
The pictures of rviz and of OpenCV windows (.png) are the only ones that are taken by hand.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn


def missing(error: ImportError) -> NoReturn:
    """End with one line that names the package which is not installed."""
    how = "pip install '.[headless,sim,detect,test]'"
    print(f"pictures.py needs {error.name}: {how}", file=sys.stderr)
    sys.exit(2)


try:
    import cv2
    import numpy as np

    from ros_visualise.core.errors import did_you_mean
except ImportError as error:
    missing(error)

ROOT = Path(__file__).parents[1]
PICTURES = ROOT / "docs" / "pictures"
DATA = Path(os.environ.get("ROS_VISUALISE_DATA", ROOT.parent / "shared" / "data"))
WIDTH = 640
FILM = "demo landscape --duration 8 --record flight.mp4@/image_raw"
WALL = "IMG_1369.JPG"
DRIVE = "sim husky --world playpen --mission square --duration 30 --record drive.bag"
DRIVE += "@/odom,/ground_truth/odom,/tf,/tf_static"
DRIVE += " --set husky.camera=false --set husky.lidar=false"
FLIGHT = "sim quadrotor --mission default --profile ideal --duration 22"
FLIGHT += " --set quadrotor.lidar=false"
QUADROTOR = f"{FLIGHT} --record field.mp4@/image_raw"

VIDEO, HUSKY = "video flight.mp4 --duration 6", "sim husky --world playpen --mission square"
IMAGES = {
    "examples/01_own_filter": f"{VIDEO} --node examples/01_own_filter.py:posterize@fps_control",
    "examples/03_frame_difference": f"{VIDEO} --node"
    " examples/03_frame_difference.py:FrameDifference@fps_control",
    "examples/06_share_of_a_colour": f"{VIDEO} --node"
    " examples/06_share_of_a_colour.py:green@fps_control",
    "examples/07_what_moves": f"{VIDEO} --node examples/07_what_moves.py:Moving@fps_control",
    "examples/08_before_and_after": f"{VIDEO} --set filters.blur=gaussian --node"
    " examples/08_before_and_after.py:change@filters,before=/controlled_stream",
    "nodes/landscape": VIDEO,
    "nodes/filters": f"{VIDEO} --preset 'black and white'",
    "nodes/edge_detector": VIDEO,
    "nodes/husky": f"{HUSKY} --duration 4",
    "nodes/quadrotor": FLIGHT,
    "nodes/tag_detector": FLIGHT,
    "nodes/landmark_detector": f"{FLIGHT} --node landmark_detector@quadrotor",
}
"""Picture -> the command whose last image it is."""

TOPICS = {
    "examples/01_own_filter": "/posterize",
    "examples/03_frame_difference": "/difference",
    "examples/06_share_of_a_colour": "/mask",
    "examples/07_what_moves": "/moving",
    "examples/08_before_and_after": "/change",
    "nodes/filters": "/processed_image",
    "nodes/edge_detector": "/edges_overlay",
    "nodes/tag_detector": "/debug_image",
    "nodes/landmark_detector": "/landmark_detector/debug_image",
}
"""Picture -> its topic, if that is not /image_raw."""

SCRIPTS = {
    "examples/14_detect_tags": "examples/14_detect_tags.py tags.png out.png",
    "examples/15_calibrate": "examples/15_calibrate.py photos out.png",
    "examples/16_choose_a_filter": "examples/16_choose_a_filter.py photo.jpg out.png",
    "examples/17_brightest_moment": "examples/17_brightest_moment.py flight.mp4 out.png",
    "examples/18_edges_beside_the_film": "examples/18_edges_beside_the_film.py flight.mp4 out.avi",
    "tags": "examples/14_detect_tags.py wall.jpg out.png",
}
"""Picture -> the script that writes it."""

PRINTED = {
    "examples/02_from_python": "examples/02_from_python.py flight.mp4",
    "examples/11_read_a_bag": "examples/11_read_a_bag.py drive.bag /odom",
    "examples/19_bags_to_csv": "examples/19_bags_to_csv.py . drives.csv",
    "examples/20_test_of_a_node": "-m pytest -q examples/20_test_of_a_node.py",
}
"""Picture -> the script whose output it shows."""

SHOTS = {
    "examples/04_nearest_obstacle": (
        f"{HUSKY} --node examples/04_nearest_obstacle.py:nearest",
        "layout={%22right%22:[%223d%22]}",
    ),
    "examples/21_own_page": ("examples/21_own_page.py", ""),
}
"""Picture -> what is run, and looked at in a browser."""

KITTI = DATA / "kitti" / "drive0009_f000-004" / "2011_09_26" / "2011_09_26_drive_0009_sync"
PAGES = {
    "page": ("video flight.mp4 --loop", 12),
    "explain": ("explain canny photo.jpg", 12),
    "kitti": (f"kitti {KITTI} --loop", 12),
    "landmarks": ("sim quadrotor --mission landing.yaml", 13),
}
"""Picture -> the page it shows in its full size, and the seconds until then."""


def main(wanted: list[str]) -> None:
    """Make all pictures, or those that are named."""
    makers: dict[str, Callable[[str], None]] = {
        **dict.fromkeys(IMAGES, image),
        **dict.fromkeys(SCRIPTS, script),
        **dict.fromkeys(PRINTED, printed),
        **dict.fromkeys(SHOTS, shot),
        **dict.fromkeys(PAGES, page),
        "examples/09_own_detector": boxes,
        "examples/10_distance_from_home": curve,
        "examples/12_compare_trajectories": trajectory,
        "examples/13_write_a_recording": waves,
        "tutorials/drift": trajectory,
        "demo": moving,
    }
    if unknown := [name for name in wanted if name not in makers]:
        print(f"no picture {unknown[0]}{did_you_mean(unknown[0], makers)}", file=sys.stderr)
        sys.exit(2)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        lend()
        for name in wanted or makers:
            print(name, flush=True)
            makers[name](name)


def lend() -> None:
    """Make the files that the commands take."""
    Path("examples").symlink_to(ROOT / "examples")
    for command in (FILM, DRIVE, QUADROTOR):
        ours(command)
    save("photo", frame_of("flight.mp4"), ".jpg", Path())
    cv2.imwrite("tags.png", frame_of("field.mp4"))
    shutil.copy(DATA / "tags" / "swatbotics" / WALL, "wall.jpg")
    Path("landing.yaml").write_text("land_on: pad\nwaypoints: [[-8, -1, 4]]\nheight: 4\nspeed: 2\n")
    Path("photos").mkdir()
    for photo in (DATA / "calib" / "opencv").glob("left[0-9]*.jpg"):
        Path("photos", photo.name).symlink_to(photo)


def ours(command: str) -> None:
    """Run a command of ours without a view, as fast as possible."""
    view = "--view none --rate 0 --overwrite" if "--duration" in command else ""
    run = f"{sys.executable} -m ros_visualise {command} {view}"
    subprocess.run(run, shell=True, check=True, capture_output=True)


def image(name: str) -> None:
    """The last image of a topic."""
    ours(f"{IMAGES[name]} --record out.mp4@{TOPICS.get(name, '/image_raw')}")
    save(name, frame_of("out.mp4"))


def script(name: str) -> None:
    """The picture or film that a script writes."""
    subprocess.run([sys.executable, *SCRIPTS[name].split()], check=True)
    target = SCRIPTS[name].split()[-1]
    save(name, frame_of(target) if target.endswith(".avi") else cv2.imread(target))


def printed(name: str) -> None:
    """What a script prints."""
    from ros_visualise.plotting.figure import Figure

    command = [sys.executable, *PRINTED[name].split()]
    text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    lines = [f"$ python {PRINTED[name]}", *text.rstrip().splitlines()]
    figure = Figure(WIDTH, 24 * len(lines) + 24)
    for number, line in enumerate(lines):
        figure.text(16, 32 + 24 * number, line, 15)
    save(name, figure.pixels())


def boxes(name: str) -> None:
    """Detections, drawn over their image."""
    import ros_visualise as rv
    from ros_visualise.data import Detections
    from ros_visualise.nodes import find

    detector = find("examples/09_own_detector.py:blobs")
    graph = rv.pipeline("flight.mp4").insert(detector, after="fps_control")
    *_, last = rv.run(graph, "/blobs", kind=Detections)
    drawn = frame_of("flight.mp4")
    for one in last.message.detections:
        cv2.polylines(drawn, [one.outline_uv.round().astype(int)], True, (0, 0, 255), 2)
    save(name, drawn)


def curve(name: str) -> None:
    """A number over time."""
    import ros_visualise as rv
    from ros_visualise.plotting.axes import PlotAxes
    from ros_visualise.plotting.colors import BLUE
    from ros_visualise.plotting.figure import Figure

    found = rv.trajectory("drive.bag", "/odom")
    seconds = (found.stamps_ns - found.stamps_ns[0]) / 1e9
    points = np.stack([seconds, np.linalg.norm(found.positions_xyz[:, :2], axis=1)], axis=1)
    figure = Figure(WIDTH, 300)
    axes = PlotAxes(figure, (60, 30, WIDTH - 90, 210), points.min(0), points.max(0))
    axes.draw("seconds", "/home: metres from the origin of the map")
    axes.curve(points, BLUE)
    save(name, figure.pixels())


def trajectory(name: str) -> None:
    """The path of a rover by its odometry, beside the true one."""
    target = PICTURES / f"{name}.svg"
    ours(
        "trajectory drive.bag --topic /odom --truth /ground_truth/odom --align origin"
        f" --plot {target} --overwrite"
    )


def waves(name: str) -> None:
    """The image in a recording that a script writes."""
    import ros_visualise as rv

    subprocess.run([sys.executable, f"{name}.py", "waves.mcap"], check=True)
    *_, last = rv.frames("waves.mcap")
    save(name, cv2.resize(last.pixels, None, fx=4, fy=4, interpolation=cv2.INTER_NEAREST))


def shot(name: str) -> None:
    """A page in a browser, some seconds after it was opened."""
    command, query = SHOTS[name]
    [picture] = watched(command, query, 1)
    save(name, picture)


def page(name: str) -> None:
    """A page in its full size, once something is to be seen."""
    command, after_s = PAGES[name]
    [picture] = watched(command, "", 1, after_s)
    save(name, picture, width=picture.shape[1])


def moving(name: str) -> None:
    """The page of the demo, which moves."""
    from PIL import Image

    width, height = 900, 553
    seen = [
        Image.fromarray(cv2.resize(one, (width, height), interpolation=cv2.INTER_AREA)[..., ::-1])
        for one in watched("demo", "", 16)
    ]
    seen[0].save(
        PICTURES / f"{name}.webp",
        save_all=True,
        append_images=seen[1:],
        duration=400,
        loop=0,
        quality=70,
    )


def watched(command: str, query: str, count: int, after_s: float = 12) -> list[np.ndarray]:
    """Screenshots of a page, half a second apart."""
    from playwright.sync_api import sync_playwright

    own = command.endswith(".py")
    words = (
        [command, "8797"] if own else ["-m", "ros_visualise", *command.split(), "--port", "8797"]
    )
    program = subprocess.Popen([sys.executable, *words], stderr=subprocess.PIPE, text=True)
    try:
        address = next(filter(None, (re.search(r"open (http\S+)", one) for one in program.stderr)))[
            1
        ]
        with sync_playwright() as started:
            flags = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
            browser = started.chromium.launch(executable_path="/usr/bin/chromium", args=flags)
            tab = browser.new_page(viewport={"width": 1400, "height": 860})
            tab.goto(f"{address}?{query}" if query else address)
            tab.wait_for_timeout(1000 * after_s)
            shots = []
            for _ in range(count):
                tab.wait_for_timeout(500)
                encoded = np.frombuffer(tab.screenshot(), np.uint8)
                shots.append(cv2.imdecode(encoded, cv2.IMREAD_COLOR))
            browser.close()
    finally:
        program.send_signal(signal.SIGINT)
        program.wait(30)
    return shots


def frame_of(film: str) -> np.ndarray:
    """The last frame of a film."""
    frames, last = cv2.VideoCapture(film), None
    while (read := frames.read())[0]:
        last = read[1]
    return last


def save(
    name: str,
    pixels: np.ndarray,
    suffix: str = ".webp",
    into: Path = PICTURES,
    width: int = WIDTH,
) -> None:
    """Write a picture, scaled down to a width."""
    height, wide = pixels.shape[:2]
    if wide > width:
        size = width, round(height * width / wide)
        pixels = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
    target = into / f"{name}{suffix}"
    target.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(target), pixels, [cv2.IMWRITE_WEBP_QUALITY, 85])


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except ImportError as error:
        missing(error)
