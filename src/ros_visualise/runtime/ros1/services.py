"""Services of the ROS graph that only ask a node to do something."""

from __future__ import annotations

from collections.abc import Callable

import rospy
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse

from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.runtime.bridge.services import answer
from ros_visualise.runtime.ros1.errors import translated


class TriggerService:
    """Offers a std_srvs/Trigger.

    Args:
        name: of the service.
        act: is run; what it returns, or an error that it raises, is the answer.
    """

    def __init__(self, name: str, act: Callable[[], str | None]) -> None:
        self._act = act
        self._service = rospy.Service(name, Trigger, self._answer)

    def _answer(self, _: TriggerRequest) -> TriggerResponse:
        return TriggerResponse(*answer(self._act))

    def close(self) -> None:
        """Offer it no longer."""
        self._service.shutdown()


def call(service: str) -> None:
    """Ask a node elsewhere on the graph to do something.

    Raises:
        Unreachable: it does not answer.
        RosVisualiseError: it has answered that it did not.
    """
    with translated(service):
        answer = rospy.ServiceProxy(service, Trigger)()
    if not answer.success:
        raise RosVisualiseError(f"{service.rpartition('/')[0]}: {answer.message}")
