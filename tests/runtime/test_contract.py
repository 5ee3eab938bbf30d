"""The contract of runtimes: the local one, a transport for tests, and Zenoh."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path

import hosts
import pytest
from contract import *  # noqa: F403  # the tests themselves
from contract import FRAMES, NODES, Running, wait_for_pipeline
from hosts import GivenHost
from hub import Hub, HubTransport
from made_videos import numbered
from zenoh_net import zenoh_net

from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.runtime.middleware import Transport
from ros_visualise.runtime.remote.runtime import RemoteRuntime
from ros_visualise.sources.playback import Playback


@pytest.fixture(
    scope="module", params=["local", "nodes", "pipeline", "zenoh nodes", "zenoh pipeline"]
)
def playing(request: pytest.FixtureRequest, video: Path) -> Iterator[Running]:
    if request.param == "local":
        images = numbered(FRAMES, 160, 120)
        runtime = LocalRuntime(image_pipeline("streamer", path=str(video)), Playback(loop=True))
        runtime.start()
        yield Running(runtime, images)
        runtime.stop()
        return
    with ExitStack() as stack:
        if "zenoh" in request.param:
            join: Callable[[str], Transport] = stack.enter_context(zenoh_net()).join
        else:
            join = partial(HubTransport, Hub())
        yield stack.enter_context(on_graph(join, video, "nodes" in request.param))


@contextmanager
def on_graph(join: Callable[[str], Transport], video: Path, are_apart: bool) -> Iterator[Running]:
    """The image pipeline as nodes of a graph: each by itself, or all in one process."""
    prefix = "" if are_apart else "pipeline/"
    with ExitStack() as stack:
        if are_apart:
            for name in sorted(NODES - {"streamer"}):
                stack.enter_context(hosts.running(name, GivenHost(join)))
            given = {"path": str(video), "loop": True}
            stack.enter_context(hosts.running("streamer", GivenHost(join, given)))
        else:
            given = {"streamer/path": str(video), "streamer/loop": True}
            host = GivenHost(join, {"source": "streamer", **given})
            stack.enter_context(hosts.running("pipeline", host))
        transport = join("tests")
        stack.callback(transport.close)
        remote = RemoteRuntime(transport)
        stack.callback(remote.close)
        wait_for_pipeline(remote, prefix)
        yield Running(remote, numbered(FRAMES, 160, 120), prefix)
