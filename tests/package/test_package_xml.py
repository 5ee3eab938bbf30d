"""What package.xml asks for, on either ROS."""

from __future__ import annotations

import ast
import re
import sys
from xml.etree import ElementTree

import pytest
from documents import DOCUMENTS, commands
from launched import LAUNCH, PACKAGE

RUNTIMES = PACKAGE / "src" / "ros_visualise" / "runtime"
KEYS = {"rospkg": "python3-rospkg"}
IN_OTHERS = {"diagnostic_aggregator", "rqt_gui", "rviz2", "usb_cam"}
"""What is started where a person has it."""


def needed(version: str, *tags: str) -> set[str]:
    """The keys of rosdep under these tags, by the conditions that hold where ROS_VERSION is so."""
    found = set()
    for element in ElementTree.parse(PACKAGE / "package.xml").getroot().iter():
        if element.tag in tags and _holds(element.get("condition", ""), version):
            found.add(str(element.text))
    return found


def _holds(condition: str, version: str) -> bool:
    if not condition:
        return True
    match = re.fullmatch(r"\$ROS_VERSION (==|!=) 2", condition)
    assert match, condition
    return (version == "2") == (match[1] == "==")


@pytest.mark.parametrize(
    ("version", "tools", "kind"),
    [
        ("", {"catkin"}, "catkin"),
        ("1", {"catkin"}, "catkin"),
        ("2", {"ament_cmake", "ament_cmake_python"}, "ament_cmake"),
    ],
)
def test_each_ros_has_its_build_tools(version, tools, kind):
    assert needed(version, "buildtool_depend") == tools
    assert needed(version, "build_type") == {kind}


@pytest.mark.parametrize(("version", "runtime"), [("1", "ros1"), ("2", "ros2")])
def test_what_a_runtime_imports_is_asked_for(version, runtime):
    ours = {"ros_visualise", "numpy", "rosbags", "cv2"}
    imported = {
        name.partition(".")[0]
        for path in (RUNTIMES / runtime).glob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        for name in (
            [alias.name for alias in node.names]
            if isinstance(node, ast.Import)
            else [str(node.module)]
            if isinstance(node, ast.ImportFrom)
            else []
        )
    }
    wanted = {KEYS.get(name, name) for name in imported - ours - set(sys.stdlib_module_names)}
    assert wanted <= needed(version, "exec_depend")


def test_a_robot_without_a_screen_needs_no_rviz2():
    assert not needed("2", "depend", "exec_depend") & {"rviz2", "rqt_gui", "diagnostic_aggregator"}


def test_colcon_runs_the_tests():
    assert "ament_cmake_pytest" in needed("2", "test_depend")
    cmake = (PACKAGE / "CMakeLists.txt").read_text()
    [folder] = re.findall(r"ament_add_pytest_test\(\w+ (\S+)", cmake)
    assert list((PACKAGE / folder).glob("test_*.py"))


@pytest.mark.parametrize(("version", "suffix"), [("1", ".launch"), ("2", ".launch.xml")])
def test_what_launch_files_start_is_asked_for(version, suffix):
    started = {
        node.attrib["pkg"]
        for path in LAUNCH.rglob(f"*{suffix}")
        for node in ElementTree.parse(path).iter("node")
    }
    assert started - IN_OTHERS - {"ros_visualise"} <= needed(version, "exec_depend")


def test_its_repository_is_what_the_documentation_clones():
    urls = ElementTree.parse(PACKAGE / "package.xml").getroot().findall("url")
    by_type = {url.get("type"): url.text for url in urls}
    calls = [words for path in DOCUMENTS for words in commands(path, "git")]
    cloned = {words[1] for words in calls if words[0] == "clone" and "vision_msgs" not in words[-1]}
    assert cloned <= {"ADDRESS", by_type.get("repository")}  # no address is known without one
