"""Our nodes run on Humble, which lacks modules that later releases have."""

from __future__ import annotations

import ast
import importlib
import os
import subprocess
import sys
from types import ModuleType

import pytest
from launched import PACKAGE

from ros_visualise.running.executables import command_of

ROS2 = PACKAGE / "src" / "ros_visualise" / "runtime" / "ros2"
EITHER = "qos_events.py"
"""The file that finds what has moved."""

IN_HUMBLE = {
    "rclpy",
    *(f"rclpy.{name}" for name in ("callback_groups", "context", "exceptions", "executors")),
    *(f"rclpy.{name}" for name in ("guard_condition", "lifecycle", "node", "parameter", "qos")),
    *(f"rclpy.{name}" for name in ("serialization", "signals", "utilities")),
    "rclpy.impl.implementation_singleton",
    "rclpy.qos_overriding_options",
}


def imported(text: str) -> set[str]:
    """The modules of rclpy that a text imports."""
    found = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom):
            found.add(str(node.module))
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return {name for name in found if name.partition(".")[0] == "rclpy"}


@pytest.mark.parametrize("path", sorted(ROS2.glob("*.py")), ids=lambda path: path.name)
def test_nothing_is_imported_that_humble_lacks(path):
    if path.name != EITHER:
        assert imported(path.read_text()) <= IN_HUMBLE


@pytest.mark.parametrize("there", ["event_handler", "qos_event"])
def test_events_are_found_where_each_release_has_them(there, monkeypatch):
    callbacks = ModuleType(f"rclpy.{there}")
    callbacks.PublisherEventCallbacks, callbacks.SubscriptionEventCallbacks = object(), object()
    monkeypatch.setitem(sys.modules, "rclpy", ModuleType("rclpy"))
    for name in ("event_handler", "qos_event"):
        found = callbacks if name == there else None  # None: cannot be imported
        monkeypatch.setitem(sys.modules, f"rclpy.{name}", found)
    monkeypatch.delitem(sys.modules, "ros_visualise.runtime.ros2.qos_events", raising=False)
    events = importlib.import_module("ros_visualise.runtime.ros2.qos_events")
    monkeypatch.delitem(sys.modules, "ros_visualise.runtime.ros2.qos_events")
    assert events.PublisherEventCallbacks is callbacks.PublisherEventCallbacks
    assert events.SubscriptionEventCallbacks is callbacks.SubscriptionEventCallbacks


@pytest.mark.parametrize(
    ("distro", "said"),
    [("galactic", "Galactic is too old"), ("humble", "setup.bash"), ("jazzy", "setup.bash")],
)
def test_a_ros_2_that_is_too_old_or_missing_is_refused_in_one_line(distro, said):
    without = {"PYTHONPATH": str(PACKAGE / "src"), "ROS_VERSION": "2", "ROS_DISTRO": distro}
    ended = subprocess.run(
        command_of("filters"),
        env=os.environ | without,
        text=True,
        capture_output=True,
    )
    assert ended.returncode == 2
    assert ended.stderr.count("\n") == 1
    assert said in ended.stderr
