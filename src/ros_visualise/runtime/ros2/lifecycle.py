"""This process as one of ROS 2's managed nodes."""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import partial
from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNodeMixin, TransitionCallbackReturn
from rclpy.node import Node

from ros_visualise.core import supervision
from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.runtime.middleware import Managed

log = logging.getLogger(__name__)


class Lifecycle(LifecycleNodeMixin):  # type: ignore[misc]
    """Offers a node's lifecycle services, such as ``~/change_state``.

    rclpy has them for nodes that are managed from their creation on; this is for one that turns out
    to be. It stands for the node where rclpy asks that for its handle and its services.

    Args:
        node: of this process; its executor is to be woken after that.
        managed: is taken through the states.
    """

    def __init__(self, node: Node, managed: Managed) -> None:
        self._node, self._managed = node, managed
        self.handle = node.handle
        self._services: list[Any] = []
        super().__init__(callback_group=MutuallyExclusiveCallbackGroup())
        change = self._service_change_state
        change.callback = partial(self._change, change.callback)
        node._services.extend(self._services)

    def close(self) -> None:
        """Offer them no longer; what holds on to the node would keep it on the graph."""
        while self._services:
            self._node.destroy_service(self._services.pop())
        self._state_machine.destroy_when_not_in_use()

    def on_configure(self, state: Any) -> TransitionCallbackReturn:
        """Open what the node needs."""
        return self._do("configure", self._managed.configure)

    def on_activate(self, state: Any) -> TransitionCallbackReturn:
        """Let the node process."""
        return self._do("activate", self._managed.activate)

    def on_deactivate(self, state: Any) -> TransitionCallbackReturn:
        """Let the node process nothing."""
        return self._do("deactivate", self._managed.deactivate)

    def on_cleanup(self, state: Any) -> TransitionCallbackReturn:
        """Close what the node has opened."""
        return self._do("cleanup", self._managed.cleanup)

    def on_shutdown(self, state: Any) -> TransitionCallbackReturn:
        """Close it for good; the process stays until it is asked to end."""
        return self._do("shutdown", self._managed.cleanup)

    def on_error(self, state: Any) -> TransitionCallbackReturn:
        """Begin anew, unconfigured, after what should not happen."""
        return self._do("cleanup", self._managed.cleanup)

    def _do(self, name: str, work: Callable[[], None]) -> TransitionCallbackReturn:
        """The outcome of a transition; rclpy says nothing of what a callback raises."""
        try:
            work()
        except RosVisualiseError as error:
            log.error("cannot %s: %s", name, error)
            return TransitionCallbackReturn.FAILURE
        except supervision.ERRORS as error:
            supervision.note(name, error)
            return TransitionCallbackReturn.ERROR
        return TransitionCallbackReturn.SUCCESS

    def _change(self, change: Callable[[Any, Any], Any], request: Any, response: Any) -> Any:
        """Answer a request; one that does not fit the state is refused, and rclpy would raise."""
        try:
            return change(request, response)
        except rclpy_implementation.RCLError:
            _, state = self._state_machine.current_state
            asked = request.transition.label or request.transition.id
            log.warning("no transition %s from the state %s", asked, state)
            response.success = False
            return response
