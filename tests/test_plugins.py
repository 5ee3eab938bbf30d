"""Packages that extend ours: installed as by a stranger, used, and reported where they fail."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from made_videos import write_video

SAMPLE = Path(__file__).parents[1] / "examples" / "plugin"
WALK = "# stamp x y z qx qy qz qw\n" + "".join(
    f"{stamp:.2f} {stamp} 0 0 0 0 0 1\n" for stamp in (1, 2, 2.5, 5)
)


class Packages:
    """A folder of packages that are installed beside ours."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def install(self, project: Path) -> None:
        """Install a project as pip does."""
        options = ["--no-index", "--no-deps", "--no-build-isolation", "--target", self.folder]
        pip = [sys.executable, "-m", "pip", "install", "--quiet", *options, project]
        subprocess.run(pip, check=True, capture_output=True, text=True, timeout=100)

    def add(self, name: str, entry_points: str, **modules: str) -> None:
        """What an installed package leaves: its modules, and its metadata."""
        for module, text in modules.items():
            (self.folder / f"{module}.py").write_text(text)
        about = self.folder / f"{name}-1.0.dist-info"
        about.mkdir()
        (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        (about / "entry_points.txt").write_text(entry_points)

    def run(self, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
        """Our command line, with these packages installed."""
        return self._run("-m", "ros_visualise", *map(str, arguments))

    def python(self, code: str) -> subprocess.CompletedProcess[str]:
        """Python code, with these packages installed."""
        return self._run("-c", code)

    def _run(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        environment = {**os.environ, "PYTHONPATH": str(self.folder)}
        command = [sys.executable, *arguments]
        return subprocess.run(command, capture_output=True, text=True, timeout=100, env=environment)


@pytest.fixture
def packages(tmp_path: Path) -> Packages:
    folder = tmp_path / "site"
    folder.mkdir()
    return Packages(folder)


@pytest.fixture(scope="module")
def sample(tmp_path_factory: pytest.TempPathFactory) -> Packages:
    """The sample that comes with us, installed."""
    made = Packages(tmp_path_factory.mktemp("site"))
    made.install(SAMPLE)
    return made


def test_the_sample_is_listed(sample):
    done = sample.run("plugins", "--json")
    found = json.loads(done.stdout)
    assert [(one["kind"], one["name"], one["package"], one["failure"]) for one in found] == [
        ("nodes", "vignette", "ros_visualise_example", ""),
        ("formats", "tum", "ros_visualise_example", ""),
        ("drawings", "compass", "ros_visualise_example", ""),
        ("panels", "clock", "ros_visualise_example", ""),
        ("lessons", "negative", "ros_visualise_example", ""),
        ("robots", "cart", "ros_visualise_example", ""),
        ("sensors", "thermometer", "ros_visualise_example", ""),
        ("worlds", "hall", "ros_visualise_example", ""),
        ("measurements", "uwb", "ros_visualise_example", ""),
        ("commands", "gaps", "ros_visualise_example", ""),
    ]
    assert (done.returncode, done.stderr) == (0, "")
    lines = sample.run("plugins").stdout.splitlines()
    assert next(line.split() for line in lines) == [
        "nodes",
        "vignette",
        "ros_visualise_example",
        "0.1.0",
    ]


def test_its_node_runs_by_its_name(sample, tmp_path):
    film, out = tmp_path / "white.mkv", tmp_path / "out.mp4"
    write_video(film, [np.full((48, 64, 3), 200, np.uint8)] * 3)
    done = sample.run(
        *("video", film, "--view", "none", "--rate", "0", "--node", "vignette@streamer"),
        *("--set", "vignette.strength=1", "--record", f"{out}@/vignette", "--json"),
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["topics"]["/vignette"]["messages"] == 3
    _, image = cv2.VideoCapture(str(out)).read()
    assert image[24, 32].mean() > 190
    assert image[0, 0].mean() < 20
    listed = sample.run("nodes").stdout
    assert "vignette: Darkens the corners" in listed
    assert "uwb (sensor_msgs/msg/Range)" in listed  # a measurement
    assert "cart: A cart" in listed


def test_its_format_is_opened_whatever_it_is_called(sample, packages, tmp_path):
    walk = tmp_path / "walk.txt"
    walk.write_text(WALK)
    found = json.loads(sample.run("info", "--json", walk).stdout)
    assert (found["format"], found["messages"], found["duration"]) == ("TUM trajectory", 4, 4.0)
    assert sample.run("convert", walk, tmp_path / "walk.mcap").returncode == 0
    without = packages.run("info", walk)
    assert without.returncode == 2
    assert f"{walk}: a trajectory; to show it:" in without.stderr


def test_its_lesson_is_written_down(sample, tmp_path):
    done = sample.run("explain", "negative", "--export", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert "both add up to 255" in " ".join((tmp_path / "out" / "index.html").read_text().split())


def test_its_command_has_help_and_an_exit_status(sample, tmp_path):
    walk = tmp_path / "walk.tum"
    walk.write_text(WALK)
    done = sample.run("gaps", walk)
    assert (done.returncode, done.stdout) == (0, "/pose: longest pause 2.500 s\n")
    assert sample.run("gaps", walk, "--above", "2").returncode == 1
    missing = sample.run("gaps", tmp_path / "none.tum")
    assert (missing.returncode, len(missing.stderr.splitlines())) == (2, 1)
    assert "gaps" in sample.run("--help").stdout
    assert "--above" in sample.run("gaps", "--help").stdout


def test_a_shell_completes_the_options_of_its_command(sample, monkeypatch):
    line = "ros-visualise gaps --ab"
    asked = {"_ARGCOMPLETE": "1", "COMP_LINE": line, "COMP_POINT": str(len(line))}
    for name, value in {**asked, "_ARGCOMPLETE_STDOUT_FILENAME": "/dev/stdout"}.items():
        monkeypatch.setenv(name, value)
    assert sample.run().stdout.strip() == "--above"


def test_its_drawing_draws(sample):
    code = (
        "from ros_visualise.data import MagneticField\n"
        "from ros_visualise.ui.scene.kinds import DRAWINGS\n"
        "print(DRAWINGS[MagneticField].__name__)"
    )
    assert sample.python(code).stdout == "Compass\n"


MEASUREMENT = """
import numpy as np
from ros_visualise.core.errors import ParameterError
from ros_visualise.estimation.imu import Mounting
from ros_visualise.estimation.params import NavigatorParams
from ros_visualise.estimation.robot import RobotState, core
from ros_visualise.estimation.sensors import SENSORS, Reading

sensor, params = SENSORS.find("uwb"), NavigatorParams(uwb_anchor="3, -2, 1")
robot = RobotState(p=np.array([8.0, 4, 6]))
at = Mounting(np.eye(3), np.array([0.1, 0, 0.2]))
reading = Reading("uwb", 0, np.array([9.0]), np.eye(1), at)
found = sensor.expect(robot, reading, params)
for row, error in enumerate(1e-6 * np.eye(core())):
    several = [sensor.expect(robot.moved(e), reading, params) for e in (-error, error)]
    slope = (several[0].residual - several[1].residual) / 2e-6
    np.testing.assert_allclose(found.H[:, row], slope, atol=1e-6, err_msg=str(row))
for name in ("uwb_anchor", "gps_origin"):
    try:
        NavigatorParams(**{name: "here"})
    except ParameterError as error:
        print(error)
"""


def test_its_measurement_has_a_right_derivative_and_checks_its_parameters_beside_others(sample):
    done = sample.python(MEASUREMENT)
    assert [line.split(":")[0] for line in done.stdout.splitlines()] == [
        "uwb_anchor=here",
        "gps_origin=here",
    ], done.stderr


@pytest.mark.usefixtures("opengl")
def test_robots_are_simulated_in_its_world_with_its_tags(sample):
    def in_hall(robot, *more):
        options = ("--duration", "1", "--rate", "0", "--view", "none", "--json")
        done = sample.run("sim", robot, "--world", "hall", *options, *more)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)["topics"]

    small = ("--size", "320x240", "--set", "quadrotor.lidar=false")
    flown = in_hall("quadrotor", *small)
    assert flown["/ground_truth/odom"]["messages"] > 40
    assert flown["/temperature"]["messages"] == 2  # by its sensor
    mapped = sample.run(
        *("landmarks", "husky", "--world", "hall", "--duration", "1", "--json"),
        *("--model", "none"),
    )
    assert mapped.returncode == 0, mapped.stderr
    (tag,) = json.loads(mapped.stdout)["landmarks"]
    assert tag["name"] == "tag36h11_7"
    assert tag["pose"]["position"] == pytest.approx([7.8, 0, 0.8], abs=0.3)
    there = "no world 'cave'; choose from plane, playpen, field, hall"
    assert there in sample.run("landmarks", "husky", "--world", "cave").stderr


CART = """
from dataclasses import replace
from ros_visualise.simulation.robots.husky import ROBOT as HUSKY
from ros_visualise.simulation.robots.husky.settings import HuskyNodeParams
from ros_visualise.simulation.source import SimulatedRobot, simulated

@simulated("cart", HuskyNodeParams, ("linear.x",))
class Cart(SimulatedRobot):
    'A rover by another name.'
    def __init__(self, params, playback):
        super().__init__("cart", params, params, playback)

ROBOT = replace(HUSKY, source=Cart)
"""


def test_a_robot_of_another_package_is_simulated(packages):
    entries = "[ros_visualise.robots]\ncart = cart\nhusky = cart\nflat = cart:CART\n"
    packages.add("carts", entries, cart=CART)
    done = packages.run(
        *("sim", "cart", "--world", "plane", "--mission", "default", "--duration", "2"),
        *("--set", "cart.camera=false", "--rate", "0", "--view", "none", "--json"),
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["topics"]["/odom"]["messages"] > 90
    assert "cart: A rover by another name." in packages.run("nodes").stdout
    assert "choose from husky, quadrotor, cart, flat" in packages.run("sim", "x").stderr
    failures = {
        one["name"]: one["failure"] for one in json.loads(packages.run("plugins", "--json").stdout)
    }
    assert failures["cart"] == ""
    assert failures["husky"] == "the name husky is built in; choose another"
    assert "has no attribute 'CART'" in failures["flat"]


PITOT = """
from dataclasses import dataclass
from ros_visualise.data import FluidPressure, Header
from ros_visualise.simulation.sensors import SensorType, setting

@dataclass(frozen=True)
class PitotParams:
    pitot: bool = setting(True, "switch the pitot tube on", group="pitot")
    pitot_rate: float = setting(20.0, "measurements per second", min=1, max=50, group="pitot")

def fit(fitting):
    def measure(stamp_ns, index):
        speed = fitting.robot.body.velocity()[0][0]
        return {"pitot": FluidPressure(0.6 * speed**2, 0.0, Header(stamp_ns, "base_link"))}
    return measure

SENSOR = SensorType(PitotParams, {"pitot": FluidPressure}, "pitot_rate", fit, "pitot")
"""


def test_every_robot_has_a_sensor_of_another_package(packages):
    packages.add("pitots", "[ros_visualise.sensors]\npitot = pitot\n", pitot=PITOT)

    def measured(robot, *more):
        done = packages.run(
            *("sim", robot, "--world", "plane", "--mission", "default", "--duration", "2"),
            *("--set", f"{robot}.camera=false", *more),
            *("--rate", "0", "--view", "none", "--json"),
        )
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)["topics"].get("/pitot", {"messages": 0})["messages"]

    assert measured("husky") == pytest.approx(40, abs=1)
    assert measured("quadrotor", "--set", "quadrotor.pitot_rate=10") == pytest.approx(20, abs=1)
    assert measured("husky", "--set", "husky.pitot=false") == 0
    (found,) = json.loads(packages.run("plugins", "--json").stdout)
    assert (found["kind"], found["name"], found["failure"]) == ("sensors", "pitot", "")


BROKEN = """[ros_visualise.nodes]
absent = no_such_module
leaving = leaving_module
plain = plain_module:NODE
filters = plain_module
[ros_visualise.formats]
bad = plain_module
[ros_visualise.worlds]
flat = plain_module
field = plain_module
[ros_visualise.nods]
typo = plain_module
"""


def test_what_fails_is_reported_and_costs_nobody_else(packages, tmp_path):
    packages.add("broken", BROKEN, leaving_module="raise SystemExit(3)", plain_module="NODE = 1")
    done = packages.run("plugins", "--json")
    failures = {one["name"]: one["failure"] for one in json.loads(done.stdout)}
    assert failures == {
        "absent": "ModuleNotFoundError: No module named 'no_such_module'",
        "leaving": "SystemExit: 3",
        "plain": "declares no node 'plain'; decorate a function with @node('plain', ...)",
        "filters": "the name filters is built in; choose another",
        "bad": "not a Format; give one, or a module with FORMAT",
        "flat": "not a World; give one, or a module with WORLD",
        "field": "the name field is built in; choose another",
        "*": "unknown group ros_visualise.nods; choose from ros_visualise.nodes,"
        " ros_visualise.formats, ros_visualise.drawings, ros_visualise.panels,"
        " ros_visualise.lessons, ros_visualise.robots, ros_visualise.sensors, ros_visualise.worlds,"
        " ros_visualise.measurements, ros_visualise.commands",
    }
    assert done.returncode == 1
    film = write_video(tmp_path / "film.mkv", [np.zeros((48, 64, 3), np.uint8)] * 3)
    played = packages.run("video", film, "--view", "none", "--rate", "0", "--json")
    assert played.returncode == 0, played.stderr
    assert json.loads(played.stdout)["topics"]["/processed_image"]["messages"] == 3
    asked = packages.run("video", film, "--view", "none", "--node", "absent")
    assert asked.returncode == 2
    assert "node 'absent' of broken cannot be loaded: ModuleNotFoundError" in asked.stderr
    asked = packages.run("sim", "husky", "--world", "flat", "--view", "none", "--duration", "1")
    assert asked.returncode == 2
    assert "world 'flat' of broken cannot be loaded: not a World" in asked.stderr


def test_a_name_belongs_to_one_package(packages):
    text = "[ros_visualise.commands]\nlook = {}\n"
    command = (
        "from dataclasses import make_dataclass\n"
        "from ros_visualise.commands import Command\n"
        "Options = make_dataclass('Options', [])\n"
        "COMMAND = Command('looks', Options, lambda options: print('{}') or 0)"
    )
    packages.add("one", text.format("of_one"), of_one=command.format("one"))
    packages.add("two", text.format("of_two"), of_two=command.format("two"))
    done = packages.run("plugins", "--json")
    failures = [one["failure"] for one in json.loads(done.stdout)]
    assert sorted(failures) == ["", "another package also uses the name look"]
    assert packages.run("look").stdout in ("one\n", "two\n")
