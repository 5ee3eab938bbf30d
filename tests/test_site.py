"""The documentation builds without a warning, needs nothing from elsewhere, and opens."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from urllib.parse import quote

import pytest
from documents import PACKAGE

from ros_visualise.commands import docs, main

ELSEWHERE = re.compile(
    r"""<(?:script|img|iframe)[^>]+src=["']?(?:https?:)?//[^>]*
    |<link(?![^>]+rel="(?:canonical|author)")[^>]+href=["']?(?:https?:)?//[^>]*
    |url\(["']?(?:https?:)?//[^)]*|@import[^;]*//[^;]*""",
    re.VERBOSE,
)
"""What a browser would load from another place."""

pytestmark = pytest.mark.timeout(300)  # the first of these tests waits for the whole site

ORIGIN = "git@github.com:me/mine.git"
"""Where the repository was cloned from, whose pages have links to it."""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built site, without the lessons, which tests/lessons exports, and the tree of pages."""
    folder = tmp_path_factory.mktemp("site")
    build = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", PACKAGE / "docs", folder]
    origin = {"GIT_CONFIG_KEY_0": "remote.origin.url", "GIT_CONFIG_VALUE_0": ORIGIN}
    env = {"PATH": "/usr/bin:/bin", "QUICK": "1", "GIT_CONFIG_COUNT": "1", **origin}
    done = subprocess.run(build, env=env, capture_output=True, text=True)
    assert not done.returncode, done.stderr
    return folder


def test_pages_load_nothing_from_elsewhere(site: Path):
    pages = [path for kind in ("html", "css", "js") for path in site.rglob(f"*.{kind}")]
    assert len(pages) > 100
    for page in pages:
        found = ELSEWHERE.search(page.read_text(errors="ignore"))
        assert not found, f"{page.name}: {found and found[0]}"


@pytest.mark.parametrize(
    ("page", "words"),
    [
        (
            "generated/nodes/edge_detector.html",
            ["l2_gradient", "0 to 800", "only while subscribed"],
        ),
        ("generated/commands/trajectory.html", ["--max-difference", "ATE"]),
        ("generated/messages.html", ["apriltag_ros/msg/AprilTagDetectionArray"]),
        ("generated/formats.html", ["PX4 flight log", ".ulg"]),
        ("changes.html", ["Forthcoming"]),
        ("howto/install.html", ["libgl1", "github.com/me/mine/blob/main/docs/howto/install.md"]),
    ],
)
def test_reference_comes_from_the_declarations(site: Path, page: str, words: list[str]):
    text = (site / page).read_text()
    assert [word for word in words if word not in text] == []


QUESTIONS = {
    "record to mcap": "howto/record-a-camera",
    "convert bag to mp4": "howto/convert-a-bag-to-video",
    "calibrate camera": "howto/calibrate-a-camera",
    "wrong colors bayer": "howto/fix-wrong-colours",
    "slow page": "howto/speed-up-a-slow-page",
    "remote machine": "howto/open-a-remote-page",
    "px4 log": "howto/play-a-flight-log",
    "print tags": "howto/print-tags",
    "landing pad": "tutorials/landing",
    "kitti to rosbag": "howto/play-kitti",
    "own node": "howto/use-my-own-node",
    "plot a field": "howto/plot-a-field",
    "trajectory error": "tutorials/trajectory",
    "train network": "tutorials/train",
    "camera not found": "howto/show-a-camera",
    "visual odometry": "howto/run-visual-odometry",
    "mosaic": "howto/make-a-mosaic",
    "mavlink": "howto/connect-an-autopilot",
    "gpu": "howto/run-networks-on-a-gpu",
    "track objects": "howto/track-objects",
    "how do I extract images from a bag": "howto/convert-a-bag-to-video",
    "undistort fisheye": "howto/remove-lens-distortion",
    "rosbag to csv": "howto/export-a-track",
    "count cars": "howto/track-objects",
    "set password for the page": "explanation/security",
    "what does exit code 1 mean": "howto/use-it-in-a-script",
    "px4 ulog viewer": "howto/play-a-flight-log",
    "write custom node python": "howto/use-my-own-node",
    "how accurate is visual odometry": "explanation/visual-odometry-accuracy",
    "drone landing on apriltag": "tutorials/landing",
    "run headless on raspberry pi": "howto/run-it-on-a-small-computer",
}
"""Words that people type -> the page that answers them."""


def test_the_search_shows_the_page_that_answers_first(site: Path, chromium):
    page = chromium.new_page()
    first = {}
    for words in QUESTIONS:
        page.goto(f"{(site / 'search.html').as_uri()}?q={quote(words)}")
        found = page.wait_for_selector("#search-results li a")
        first[words] = found.get_attribute("href").partition(".html")[0]
    page.close()
    assert first == QUESTIONS


def test_docs_prints_the_address_of_a_page(site: Path, monkeypatch, capsys):
    monkeypatch.setattr(docs, "SITES", (site,))
    assert main(["docs", "--no-open", "edge_detector"]) == 0
    assert capsys.readouterr().out == f"{(site / 'generated/nodes/edge_detector.html').as_uri()}\n"
    assert main(["docs", "--no-open", "edge_detecter"]) == 2
    assert "did you mean edge_detector?" in capsys.readouterr().err


def test_docs_without_a_built_site_is_one_line(tmp_path: Path, monkeypatch, capsys):
    monkeypatch.setattr(docs, "SITES", (tmp_path,))
    assert main(["docs"]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert line.endswith("not built; in a clone of the repository run: make docs")
