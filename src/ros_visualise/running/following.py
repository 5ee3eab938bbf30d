"""What a person opens from the page, in place of what is played."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from ros_visualise.graph import Graph
from ros_visualise.running.graphs import Selection, film, graph_of, recording
from ros_visualise.running.options import PlayingOptions
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.opening import is_recording

_OF_RECORDINGS = ("tf_parent", "tf_child")
"""Parameters that tell what to follow in one recording, and not how."""


def following(
    selection: Selection, options: PlayingOptions, path: Path, runtime: LocalRuntime
) -> tuple[Selection, PlayingOptions, Graph]:
    """Another file, how it is played, and its graph: the same nodes, set as they are now.

    Args:
        selection: what is shown.
        options: those of what is shown.
        path: the other file.
        runtime: runs what is shown.

    Raises:
        OpenError: it cannot be opened.
        UsageError: the nodes that were asked for have nothing to do there.
    """
    assert runtime.playback is not None
    state, source = runtime.playback.state, runtime.graph.source
    if selection.another is not None:
        selected = selection.another(str(path))
    elif is_recording(path):
        selected = replace(recording(str(path)), size=selection.size)
    else:
        selected = film(str(path), selection.size)
    options = replace(  # without what was for the first file, or is done
        options,
        start=None,
        set=[],
        params=None,
        preset="",
        record=[],
        paused=not (state.playing or state.ended),
        rate=state.rate,
        loop=state.loop and not (source and source.type.seamless),
    )
    graph = graph_of(selected, options)
    return selected, options, graph.configured(_settings(runtime, graph))


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
