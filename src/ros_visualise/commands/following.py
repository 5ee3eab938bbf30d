"""What a person opens from the page, in place of what is played."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import Any

from ros_visualise.commands.graphs import graph_of
from ros_visualise.graph import Graph
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.opening import is_recording

_OF_RECORDINGS = ("tf_parent", "tf_child")
"""Parameters that tell what to follow in one recording, and not how."""


def following(args: Namespace, path: Path, runtime: LocalRuntime) -> tuple[Namespace, Graph]:
    """The command that shows another file, and its graph: the same nodes, set as they are now.

    Args:
        args: the command of what is shown.
        path: the other file.
        runtime: runs what is shown.

    Raises:
        OpenError: it cannot be opened.
        UsageError: the command's nodes have nothing to do there.
    """
    assert runtime.playback is not None
    state, source = runtime.playback.state, runtime.graph.source
    given: dict[str, Any] = {
        "command": "bag" if is_recording(path) else "video",
        "input": str(path),
        "size": "",
        **{"topics": [], "image": None, "odom": None, "start": None},  # of what was shown
        **{"set": [], "params": None, "preset": "", "record": []},  # which was done
        "paused": not (state.playing or state.ended),
        **{"rate": state.rate, "loop": state.loop and not (source and source.type.seamless)},
    }
    if args.command == "explain":  # the lesson goes on
        del given["command"]
    elif "size" in args:
        given["size"] = args.size
    following = Namespace(**{**vars(args), **given})
    graph = graph_of(following)
    return following, graph.configured(_settings(runtime, graph))


def _settings(runtime: LocalRuntime, graph: Graph) -> dict[str, dict[str, Any]]:
    """Node -> its parameters as they are now, of those that are in another graph too."""
    there = {node.name: type(node.params) for node in runtime.graph.nodes}
    return {
        node.name: {
            name: value
            for name, value in vars(runtime.parameters[node.name].current).items()
            if name not in _OF_RECORDINGS
        }
        for node in graph.nodes
        if there.get(node.name) is type(node.params)
    }
