"""The actions of nodes as services of the ROS graph."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import rospy
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse

from ros_visualise.errors import RosVisualiseError
from ros_visualise.runtime.local import LocalRuntime


class ActionServices:
    """A std_srvs/Trigger service for each action of each node: ``~clear``, ``~land``.

    Args:
        runtime: what runs the nodes.
        namespaces: node name -> where its services are below this node's private namespace.
    """

    def __init__(self, runtime: LocalRuntime, namespaces: Mapping[str, str]) -> None:
        self._runtime = runtime
        self._services = [
            rospy.Service(
                f"~{namespaces[node.name]}/{action}".replace("~/", "~"),
                Trigger,
                partial(self._act, node.name, action),
            )
            for node in runtime.graph.members
            for action in node.type.actions
        ]

    def _act(self, node: str, action: str, _: TriggerRequest) -> TriggerResponse:
        try:
            self._runtime.act(node, action)
        except RosVisualiseError as error:
            return TriggerResponse(False, str(error))
        return TriggerResponse(True, "")

    def close(self) -> None:
        """Offer them no longer."""
        for service in self._services:
            service.shutdown()


def call(node: str, action: str) -> None:
    """Ask a node elsewhere on the graph to do something.

    Raises:
        RosVisualiseError: it cannot be asked, or has answered that it did not.
    """
    try:
        answer = rospy.ServiceProxy(f"{node}/{action}", Trigger)()
    except (rospy.ServiceException, rospy.ROSException) as error:
        raise RosVisualiseError(f"{node}/{action}: {error}") from error
    if not answer.success:
        raise RosVisualiseError(f"{node}: {answer.message}")
