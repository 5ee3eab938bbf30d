"""No command asks anybody on the network, or leaves anything that nobody asked for.

Each of them runs where no route leads out, with a home and a folder for temporary files that are
empty, and the kernel's log of its calls is read.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import cv2
import pytest
import zstandard
from made_videos import numbered, write_video
from traced import can_trace, trace

from ros_visualise.commands import _parser

_OF_THE_TESTS = ("ORT_", "MESA_", "__GL_", "CI", "XDG_", "DISPLAY", "TF_BUILD", "PYTHONDONTWRITE")
NOTHING: list[str] = []
SETS = [f"set*/{'/'.join('*' * depth)}" for depth in range(2, 6)]
"""Files of a data set."""
_BOARDS = " ".join(f"{{data}}/calib/opencv/left0{number}.jpg" for number in range(1, 7))
COMMANDS: dict[str, tuple[str, list[str]]] = {
    "demo": ("demo --view none --frames 3 --rate 0", NOTHING),
    "demo, page": ("demo landscape --frames 60", NOTHING),
    "demo, page for others": ("demo landscape --frames 60 --host 0.0.0.0", NOTHING),
    "sim": ("sim quadrotor --view none --frames 3 --rate 0 --navigate", NOTHING),
    "sim, page": ("sim husky --world plane --duration 2 --record run.mcap", ["run.mcap"]),
    "video": (
        "video {video} --view none --rate 0 --node landmark_detector@streamer"
        " --record e.mp4@/edges",
        ["e.mp4"],
    ),
    "video, page": ("video {video} --loop --frames 60", NOTHING),
    "video, windows": ("video {video} --view windows --frames 3", NOTHING),
    "view": ("view --view none --listen tcp/127.0.0.1:0 --duration 1", NOTHING),
    "camera": ("camera test --view none --frames 3", NOTHING),
    "bag": ("bag {data}/bags/evo_tf_example.bag --view none --rate 0", NOTHING),
    "bag, compressed": ("bag {packed} --view none --rate 0", NOTHING),
    "kitti": ("kitti {kitti} --view none --rate 0 --record k.bag", ["k.bag"]),
    "explain": (
        "explain vision --view none --frames 2 --export lesson",
        ["lesson", "lesson/*"],
    ),
    "info": ("info --check --json {video}", NOTHING),
    "convert": (
        "convert {data}/bags/evo_tf_example.bag out",
        ["out", "out/out_0.mcap", "out/metadata.yaml"],
    ),
    "landmarks": ("landmarks {data}/tags/swatbotics --size 0.127 --json", NOTHING),
    "odometry": (
        "odometry {kitti} --out way.tum --plot way.png --covariances way.txt",
        ["way.tum", "way.png", "way.txt"],
    ),
    "trajectory": (
        "trajectory {data}/bags/robot_localization_test1.bag way.tum --plot way.png"
        " --topic /husky_velocity_controller/odom",
        ["way.tum", "way.png"],
    ),
    "calibrate": (f"calibrate {_BOARDS} --size 9x6 --output cam.yaml", ["cam.yaml"]),
    "tags": ("tags tags.pdf --ids 0,1 --size 0.05", ["tags.pdf"]),
    "batch": (
        "batch {data}/bags/evo_tf_example.bag --out out",
        ["out", "out/*", "out/tasks/*", "out/tasks/*/*"],
    ),
    "query": ("query {results} --csv answer.csv", ["answer.csv*"]),
    "compare": ("compare {results} {results} --junit compared.xml", ["compared.xml"]),
    "dataset": ("dataset {results} set --format lerobot", ["set*", "set*/*", *SETS]),
    "nodes": ("nodes", NOTHING),
    "plugins": ("plugins", NOTHING),
    "completion": ("completion bash", NOTHING),
}
"""Command -> how it is called, and what it was asked to write."""
_NOT_HERE = {"docs", "live"}
"""Commands that need a built site, or a server to ask."""
_VISITED = [sys.executable, str(Path(__file__).with_name("visited.py"))]
TEMPORARY = {
    "bag, compressed": "ros_visualise_",
    "video, windows": "ros_visualise-font-",
    "batch": "pymp-",  # sockets of Python's processes
}
"""Those that need a folder of their own for a while -> how its name begins."""


@pytest.fixture(scope="module")
def inputs(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """What the commands read."""
    if not can_trace():
        if os.environ.get("CI"):
            pytest.fail("nothing can be traced: apt-get install strace")
        pytest.skip("nothing can be traced: apt-get install strace, and allow user namespaces")
    folder = tmp_path_factory.mktemp("inputs")
    drive = recordings / "kitti" / "drive0009_f000-004" / "2011_09_26"
    batch = ["batch", drive, "--out", folder / "results"]
    subprocess.run([sys.executable, "-m", "ros_visualise", *batch], check=True)
    return {
        "results": folder / "results",
        "data": recordings,
        "video": write_video(folder / "film.mkv", numbered(8, 64, 48)),
        "packed": _packed(recordings / "bags" / "evo_tf_example", folder / "packed"),
        "kitti": drive,
    }


def test_every_command_is_among_them():
    [parsers] = [one for one in _parser()._actions if one.dest == "command"]
    called = {name.partition(",")[0] for name in COMMANDS}
    assert called | _NOT_HERE == set(parsers.choices)


@pytest.mark.timeout(400)  # what is watched takes several times as long
@pytest.mark.parametrize("name", COMMANDS)
def test_leaves_no_traces(name: str, inputs: dict[str, Path], tmp_path: Path):
    line, named = COMMANDS[name]
    folders = {one: tmp_path / one for one in ("work", "home", "temporary")}
    for folder in folders.values():
        folder.mkdir()
    command = [sys.executable, "-m", "ros_visualise", *line.format(**inputs).split()]
    within = _screen() if name.endswith("windows") else _VISITED if "page" in name else []
    environment = _environment(folders)
    done, traces = trace(command, folders["work"], environment, tmp_path / "log", within)
    assert done.returncode == 0, done.stderr
    assert traces.asked == []
    for path in traces.written:
        assert _is_named(path, folders["work"], named) or _is_temporary(path, name, folders)
    assert [*folders["home"].rglob("*"), *folders["temporary"].rglob("*")] == []


def _is_named(path: Path, work: Path, named: list[str]) -> bool:
    return path.is_relative_to(work) and any(path.relative_to(work).match(one) for one in named)


def _is_temporary(path: Path, name: str, folders: dict[str, Path]) -> bool:
    """Whether it is in a folder that the command may have for a while."""
    temporary = folders["temporary"]
    if name not in TEMPORARY or not path.is_relative_to(temporary):
        return False
    first = (*path.relative_to(temporary).parts, "")[0]
    is_a_trial = path.parent == temporary and not path.suffix  # of Python: can one write here?
    return first.startswith(TEMPORARY[name]) or is_a_trial


def _environment(folders: dict[str, Path]) -> dict[str, str]:
    """That of the tests, with nothing that would keep libraries quiet."""
    kept = {name: of for name, of in os.environ.items() if not name.startswith(_OF_THE_TESTS)}
    own = {"HOME": folders["home"], "TMPDIR": folders["temporary"]}
    return kept | {name: str(folder) for name, folder in own.items()}


def _packed(bag: Path, folder: Path) -> Path:
    """A ROS 2 bag of SQLite, compressed as a whole."""
    [file] = bag.glob("*.db3")
    name = f"{file.name}.zstd"
    folder.mkdir()
    (folder / name).write_bytes(zstandard.compress(file.read_bytes()))
    metadata = (bag / "metadata.yaml").read_text()
    (folder / "metadata.yaml").write_text(metadata.replace(file.name, name))
    return folder


def _screen() -> list[str]:
    """A program that runs another one on a screen of its own."""
    has_windows = not re.search(r"GUI: +NONE", cv2.getBuildInformation())
    if not (shutil.which("xvfb-run") and has_windows):
        if os.environ.get("CI"):
            pytest.fail("install xvfb, xauth and the extra `desktop`")
        pytest.skip("needs xvfb, xauth and an OpenCV with windows: pip install '.[desktop]'")
    return ["xvfb-run", "-a"]
