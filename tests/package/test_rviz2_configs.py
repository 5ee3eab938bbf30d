"""The configurations of rviz2 show what those of rviz show, and ask for what is offered."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from launched import PACKAGE

from ros_visualise.graph.landmarks import with_tags
from ros_visualise.graph.pipelines import simulation_pipeline

CONFIG = PACKAGE / "config"
FILES = sorted(path.name for path in CONFIG.glob("*.rviz"))


def displays(path: Path) -> Iterator[tuple[str, str, list[Any]]]:
    """Each display's name, its class without the plug-in, and its topics."""
    for display in yaml.safe_load(path.read_text())["Visualization Manager"]["Displays"]:
        topics = [value for key, value in display.items() if key.endswith("Topic")]
        yield display["Name"], display["Class"].partition("/")[2], topics


@pytest.mark.parametrize("name", FILES)
def test_both_show_the_same(name: str) -> None:
    shown = [
        (*which, [t["Value"] for t in topics])
        for *which, topics in displays(CONFIG / "ros2" / name)
    ]
    expected = [
        (title, kind, ["robot_description"] if kind == "RobotModel" else topics)
        for title, kind, topics in displays(CONFIG / name)
    ]
    assert shown == expected


@pytest.mark.parametrize("name", FILES)
def test_classes_are_those_of_rviz2(name: str) -> None:
    text = (CONFIG / "ros2" / name).read_text()
    plugins = {line.split()[-1].split("/")[0] for line in text.splitlines() if "Class: r" in line}
    assert plugins == {"rviz_common", "rviz_default_plugins"}
    assert "Unreliable" not in text


@pytest.mark.parametrize("name", FILES)
def test_what_is_kept_for_the_late_is_asked_of_those_who_keep_it(name: str) -> None:
    """A subscriber that asks for more than a publisher offers would get nothing."""
    graph = with_tags(simulation_pipeline("husky"), True, "" if name == "navigation.rviz" else None)
    latched = {
        topic.removeprefix("/")
        for member in graph.members
        for port, topic in member.outputs.items()
        if port in member.type.latched
    }
    for title, _, topics in displays(CONFIG / "ros2" / name):
        for topic in topics:
            asks = topic["Durability Policy"] == "Transient Local"
            assert not asks or topic["Value"] in latched, title
            assert topic["Reliability Policy"] in ("Reliable", "Best Effort")


def test_analyzers_are_the_same() -> None:
    ros1 = yaml.safe_load((CONFIG / "diagnostics.yaml").read_text())
    ros2 = yaml.safe_load((CONFIG / "ros2" / "diagnostics.yaml").read_text())["/**"]
    given = dict(ros2["ros__parameters"])
    assert (given.pop("path"), given.pop("pub_rate")) == ("Robot", ros1["pub_rate"])
    for analyzer in given.values():
        [analyzer["regex"]] = analyzer["regex"]
    assert given == ros1["analyzers"]
