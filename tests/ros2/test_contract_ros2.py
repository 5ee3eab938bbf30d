"""The contract of runtimes over a ROS 2 graph: the image pipeline as four nodes, and as one."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from contract import *  # noqa: F403  # the tests themselves
from contract import FRAMES, NODES, Running, wait_for_pipeline
from made_videos import numbered
from ros2_graph import Nodes2

from ros_visualise.runtime.remote.runtime import RemoteRuntime
from ros_visualise.runtime.ros2.transport import Ros2Transport


@pytest.fixture(scope="module", params=["nodes", "pipeline"])
def playing(request: pytest.FixtureRequest, video: Path, ros2: Ros2Transport) -> Iterator[Running]:
    nodes = Nodes2()
    prefix = "" if request.param == "nodes" else "pipeline/"
    if request.param == "nodes":
        for name in sorted(NODES - {"streamer"}):
            nodes.start(name)
        nodes.start("streamer", path=video, loop=True)
    else:
        nodes.start("pipeline", source="streamer", streamer__path=video, streamer__loop=True)
    remote = RemoteRuntime(ros2)
    try:
        wait_for_pipeline(remote, prefix)
        yield Running(remote, numbered(FRAMES, 160, 120), prefix)
    finally:
        remote.close()
        nodes.stop()
