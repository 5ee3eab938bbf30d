"""The contract of runtimes: over the local one, and over a middleware that is no ROS."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from contract import *  # noqa: F403  # the tests themselves
from contract import FRAMES, NODES, Running, wait_for_pipeline
from hub import Hub, HubTransport
from made_videos import numbered

from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.runtime.middleware import Transport
from ros_visualise.runtime.remote.runtime import RemoteRuntime
from ros_visualise.sources.playback import Playback


@pytest.fixture(scope="module", params=["local", "nodes", "pipeline"])
def playing(request: pytest.FixtureRequest, video: Path) -> Iterator[Running]:
    images = numbered(FRAMES, 160, 120)
    if request.param == "local":
        runtime = LocalRuntime(image_pipeline("streamer", path=str(video)), Playback(loop=True))
        runtime.start()
        yield Running(runtime, images)
        runtime.stop()
        return
    hub, prefix = Hub(), "" if request.param == "nodes" else "pipeline/"
    with ExitStack() as stack:
        if request.param == "nodes":
            for name in sorted(NODES - {"streamer"}):
                stack.enter_context(hub.running(name))
            stack.enter_context(hub.running("streamer", path=str(video), loop=True))
        else:
            own = {"streamer__path": str(video), "streamer__loop": True}
            stack.enter_context(hub.running("pipeline", source="streamer", **own))
        transport: Transport = HubTransport(hub, name="tests")
        remote = RemoteRuntime(transport)
        stack.callback(remote.close)
        wait_for_pipeline(remote, prefix)
        yield Running(remote, images, prefix)
