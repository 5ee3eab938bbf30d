"""The actions of nodes as services of the graph."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.runtime.middleware import Handle, Transport


def offer_actions(
    transport: Transport, runtime: LocalRuntime, namespaces: Mapping[str, str]
) -> list[Handle]:
    """A std_srvs/Trigger service for each action of each node: ``~clear``, ``~land``.

    Args:
        transport: what they are offered on.
        runtime: what runs the nodes.
        namespaces: node name -> where its services are below this node's private namespace.
    """
    return [
        transport.offer(
            f"~{namespaces[node.name]}/{action}".replace("~/", "~"),
            partial(runtime.act, node.name, action),
        )
        for node in runtime.graph.members
        for action in node.type.actions
    ]
