"""A kind of message is one file in ``data``: then it is played, recorded, plotted and sent."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from sample_messages import sample
from through import ROS1, ROS2, assert_same

import ros_visualise
from ros_visualise.core.message import Message, topic_kinds
from ros_visualise.data import DiagnosticArray
from ros_visualise.data.ros_fields import TabledMessage
from ros_visualise.data.wrenches import WrenchStamped
from ros_visualise.graph.pipelines import recording_pipeline
from ros_visualise.messages import from_message, to_message
from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.recorded import TopicType, content
from ros_visualise.sinks import open_recorder
from ros_visualise.sources.opening import open_recording
from ros_visualise.ui.live.trees import fields_of, tree_of

WRENCHES = [
    WrenchStamped(np.array([0, 0, 10.0 + n]), np.zeros(3), sample(WrenchStamped).header)
    for n in range(5)
]


# the levels of diagnostics are no numbers of any size
FOUND = {kind for kind in topic_kinds() if issubclass(kind, TabledMessage)} - {DiagnosticArray}
TABLED = sorted(FOUND, key=lambda kind: kind.__name__)


@pytest.mark.parametrize("kind", TABLED, ids=lambda kind: kind.__name__)
@pytest.mark.parametrize("types", [ROS1, ROS2], ids=["ros1", "ros2"])
def test_every_kind_in_a_table_survives(kind: type[Message], types: Definitions) -> None:
    data = types.write(kind.type_name, to_message(sample(kind), types.types))
    read = from_message(types.read(kind.type_name, data), kind)
    assert types.write(kind.type_name, to_message(read, types.types)) == data


def test_no_other_file_names_it() -> None:
    root = Path(ros_visualise.__file__).parent
    naming = [path.name for path in root.rglob("*.py") if "Wrench" in path.read_text()]
    assert naming == ["wrenches.py"]


@pytest.mark.parametrize("name", ["r.bag", "r.mcap", "folder"])
def test_it_is_recorded_played_and_plotted(name: str, tmp_path: Path) -> None:
    target = tmp_path / name
    with open_recorder(str(target), {"/wrench": TopicType(WrenchStamped.type_name)}) as recorder:
        for number, wrench in enumerate(WRENCHES):
            recorder.write("/wrench", wrench, number)
    with closing(open_recording(target)) as recording:
        messages = [entry.message for entry in recording.read()]
        graph = recording_pipeline(recording)
    for message, wrench in zip(messages, WRENCHES, strict=True):
        assert_same(content(message), wrench)
    assert graph.topics["/wrench"].type is WrenchStamped
    assert "wrench.force.z" in fields_of(messages[0])
    assert tree_of(messages[0])["wrench"]["torque"] == {"x": 0.0, "y": 0.0, "z": 0.0}
