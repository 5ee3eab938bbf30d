"""The actions of nodes as services of the graph."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.runtime.middleware import Handle, Middleware


def offer_actions(
    middleware: Middleware, runtime: LocalRuntime, namespaces: Mapping[str, str]
) -> list[Handle]:
    """A std_srvs/Trigger service for each action of each node: ``~clear``, ``~land``.

    Args:
        middleware: what they are offered on.
        runtime: what runs the nodes.
        namespaces: node name -> where its services are below this node's private namespace.
    """
    return [
        middleware.offer(
            f"~{namespaces[node.name]}/{action}".replace("~/", "~"),
            partial(runtime.act, node.name, action),
        )
        for node in runtime.graph.members
        for action in node.type.actions
    ]
