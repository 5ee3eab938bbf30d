"""The contract of runtimes over a ROS 1 graph: the image pipeline as four nodes, and as one."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from contract import *  # noqa: F403  # the tests themselves
from contract import FRAMES, NODES, Running, wait_for_pipeline
from made_videos import numbered
from ros_graph import Master, Nodes

from ros_visualise.runtime.remote.runtime import RemoteRuntime
from ros_visualise.runtime.ros1.transport import Ros1Transport


@pytest.fixture(scope="module", params=["nodes", "pipeline"])
def playing(request: pytest.FixtureRequest, video: Path, ros_master: Master) -> Iterator[Running]:
    nodes = Nodes(ros_master)
    prefix = "" if request.param == "nodes" else "pipeline/"
    if request.param == "nodes":
        for name in sorted(NODES - {"streamer"}):
            nodes.start(name, wait=False)
        nodes.start("streamer", f"_path:={video}", "_loop:=true")
    else:
        own = [f"_streamer/path:={video}", "_streamer/loop:=true"]
        nodes.start("pipeline", "_source:=streamer", *own)
    remote = RemoteRuntime(Ros1Transport())
    try:
        wait_for_pipeline(remote, prefix)
        yield Running(remote, numbered(FRAMES, 160, 120), prefix)
    finally:
        remote.close()
        nodes.stop()
