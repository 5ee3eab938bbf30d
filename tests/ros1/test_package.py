"""The package builds in a catkin workspace, and ROS finds what is in it, in both spaces."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from catkin_workspace import PACKAGE, Workspace
from ros_graph import Master, end, wait_for
from test_plugins import SAMPLE, Packages

from ros_visualise.running.executables import command_of, names

EXECUTABLES = names()
SPACES = ("devel", "install")
VIGNETTE = ("node.launch", "node:=vignette", "input:=image_raw")


@pytest.fixture(scope="module")
def built(workspace: Workspace) -> Workspace:
    workspace.install()
    return workspace


def call(environment: dict[str, str], *command: str) -> str:
    done = subprocess.run(command, env=environment, text=True, capture_output=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.parametrize("space", SPACES)
def test_executables_name_the_interpreter_of_the_workspace(built, space):
    folder = built.folder / space / "lib" / "ros_visualise"
    found = sorted(path for path in folder.iterdir() if os.access(path, os.X_OK))
    assert [path.name for path in found] == EXECUTABLES
    for path in found:
        assert path.read_text().splitlines()[0] == f"#!{sys.executable}"


def test_a_script_does_what_the_tests_start(built):
    for name in EXECUTABLES:
        script = built.folder / "install" / "lib" / "ros_visualise" / name
        [*_, code] = command_of(name)
        assert script.read_text().rstrip() == f"#!{sys.executable}\n{code}".rstrip()


def test_a_node_that_is_added_has_an_executable_after_the_next_build(built, tmp_path):
    source, build = tmp_path / "source", tmp_path / "build"
    shutil.copytree(PACKAGE / "src", source / "src", ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("CMakeLists.txt", "package.xml"):
        shutil.copy(PACKAGE / name, source)
    interpreter = f"-DPYTHON_EXECUTABLE={sys.executable}"
    environment = built.environment | {"PYTHONPATH": "", "PYTHONDONTWRITEBYTECODE": "1"}
    call(environment, "cmake", "-S", str(source), "-B", str(build), interpreter)
    executable = build / "devel" / "lib" / "ros_visualise" / "added"
    assert (executable.with_name("path").exists(), executable.exists()) == (True, False)
    (source / "src" / "ros_visualise" / "nodes" / "added.py").touch()
    call(environment, "cmake", "--build", str(build))
    assert os.access(executable, os.X_OK)


@pytest.mark.parametrize(("space", "home"), [("devel", "src"), ("install", "install/share")])
def test_rospack_finds_the_package(built, space, home):
    found = call(built.set_up(space), "rospack", "find", "ros_visualise")
    assert found.strip() == str(built.folder / home / "ros_visualise")


@pytest.mark.parametrize("space", SPACES)
def test_rosrun_finds_one_executable(built, space):
    """With no master it goes no further than the choice, which it would ask a person for."""
    environment = {**built.set_up(space), "ROS_MASTER_URI": "http://127.0.0.1:1"}
    debug = call(environment, "rosrun", "--debug", "--prefix", "echo", "ros_visualise", "path")
    chosen = debug.strip().splitlines()[-1]
    assert Path(chosen) == built.folder / space / "lib" / "ros_visualise" / "path"


@pytest.mark.parametrize("space", SPACES)
def test_node_runs(built, ros_master, space):
    name = f"/from_{space}"
    command = ["rosrun", "ros_visualise", "fps_control", f"__name:={name[1:]}"]
    process = subprocess.Popen(
        command,
        env=built.set_up(space),
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    try:
        service = f"{name}/set_parameters"
        wait_for(lambda: service in ros_master.call("rosservice", "list"), service)
    finally:
        end(process)


@pytest.fixture(scope="module")
def plugin(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the sample of a package that adds a node, installed."""
    packages = Packages(tmp_path_factory.mktemp("site"))
    packages.install(SAMPLE)
    return packages.folder


@pytest.mark.parametrize(
    ("space", "command"),
    [
        ("install", ("rosrun", "ros_visualise", "node", "vignette", "image:=image_raw")),
        *((space, ("roslaunch", "ros_visualise", *VIGNETTE)) for space in SPACES),
    ],  # rosrun would find the program node of the tests' environment, too, in the devel space
)
def test_a_node_of_another_package_runs_by_its_name(built, plugin, ros_master, space, command):
    environment = built.set_up(space)
    environment["PYTHONPATH"] = f"{plugin}:{environment['PYTHONPATH']}"
    process = subprocess.Popen(
        command, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    try:
        wait_for(
            lambda: topics_of(ros_master, "/vignette") >= {"/image_raw", "/vignette"}, "/vignette"
        )
    finally:
        print(end(process))
    wait_for(lambda: not topics_of(ros_master, "/vignette"), "the end of /vignette")


def topics_of(master: Master, node: str) -> set[str]:
    """What a node takes and publishes."""
    _, _, (published, subscribed, _) = master.proxy().getSystemState("/tests")
    return {topic for topic, nodes in [*published, *subscribed] if node in nodes}


@pytest.mark.parametrize("space", SPACES)
def test_rosrun_completes_the_executables(built, space):
    complete = (
        "source /usr/share/bash-completion/completions/rosbash; "
        "COMP_WORDS=(rosrun ros_visualise ''); COMP_CWORD=2; "
        '_roscomplete_exe; printf "%s\\n" "${COMPREPLY[@]}"'
    )
    assert sorted(call(built.set_up(space), "bash", "-c", complete).split()) == EXECUTABLES


@pytest.mark.parametrize("space", SPACES)
def test_roslaunch_finds_launch_files_and_nodes(built, space):
    environment = built.set_up(space)
    launch = ("ros_visualise", "main_video.launch", "video:=flight.mp4")
    command = call(environment, "roslaunch", "--args=/filters", *launch)
    assert command.split()[0] == f"{built.folder}/{space}/lib/ros_visualise/filters"
    files = call(environment, "roslaunch", "--files", *launch).split()
    home = built.folder / ("src" if space == "devel" else "install/share") / "ros_visualise"
    assert str(home / "launch" / "main_video.launch") in files


@pytest.mark.parametrize(
    ("space", "home"), [("devel", "src/ros_visualise/src"), ("install", "install/lib")]
)
def test_package_is_imported_from_its_space(built, space, home):
    code = "import ros_visualise.commands; print(ros_visualise.commands.__file__)"
    imported = call(built.set_up(space), sys.executable, "-c", code)
    assert Path(imported.strip()).is_relative_to(built.folder / home)


def test_whole_package_is_installed(built):
    [installed] = (built.folder / "install" / "lib").glob("python3*/*/ros_visualise")
    source = PACKAGE / "src" / "ros_visualise"
    files, expected = (
        {str(path.relative_to(home)) for path in home.rglob("*.*") if path.suffix != ".pyc"}
        for home in (installed, source)
    )
    assert files == expected
    share = built.folder / "install" / "share" / "ros_visualise"
    for folder, others in (("launch", ".xml"), ("config", "")):  # launch/*.launch.xml are for ROS 2
        there = [path for path in (PACKAGE / folder).rglob("*.*") if path.suffix != others]
        expected = {str(path.relative_to(PACKAGE)) for path in there}
        assert {str(path.relative_to(share)) for path in (share / folder).rglob("*.*")} == expected


def test_catkin_lint_is_content(built):
    package = str(built.folder / "src" / "ros_visualise")  # whose name is the package's there
    done = subprocess.run(
        ["catkin_lint", "-W2", "--strict", "--offline", package],
        env=built.environment,
        text=True,
        capture_output=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stdout
