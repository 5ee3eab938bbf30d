"""This process as a node of the ROS 2 graph: its start, its threads and its end."""

from __future__ import annotations

import logging
import os
import re
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache, partial
from typing import Any, TypeVar
from weakref import WeakSet

import rclpy
from rclpy.context import Context
from rclpy.executors import MultiThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions

from ros_visualise.core import supervision
from ros_visualise.core.errors import UsageError
from ros_visualise.runtime.middleware import Handle, Managed
from ros_visualise.runtime.ros2.errors import translated
from ros_visualise.runtime.ros2.lifecycle import Lifecycle

_VARIABLE = "CYCLONEDDS_URI"

_SETTINGS = """<CycloneDDS><Domain>
<General><MaxMessageSize>65500B</MaxMessageSize><FragmentSize>63000B</FragmentSize></General>
<Internal>
<NackDelay>1ms</NackDelay>
<SocketReceiveBufferSize max="16MB"/>
</Internal>
</Domain></CycloneDDS>"""
"""The largest pieces that UDP takes, and as much room for them as the system gives a socket."""


def configure_cyclone() -> None:
    """Let Cyclone DDS send large messages in large pieces; a person's own settings stay.

    By itself it cuts them into pieces of 1344 bytes, and asks for one that was lost after a tenth
    of a second. An image of 25 MB is 18 000 of those, and a few are lost whenever the
    subscriber does not read for a moment: at 30 images each second most are never complete.

    Source: the guide to the options of Cyclone DDS 0.10, ``General`` and ``Internal``.
    """
    os.environ.setdefault(_VARIABLE, "".join(_SETTINGS.splitlines()))


Convert = Callable[[Parameter], Parameter]


class GraphNode(Node):  # type: ignore[misc]
    """Converts the parameters that it is asked to set, before rclpy compares their types.

    ``ros2 param set`` and ``load`` take ``off`` for a bool and ``2`` for an int.

    Attributes:
        convert: gives a parameter in the type that is declared.
    """

    convert: Convert = staticmethod(lambda asked: asked)

    def set_parameters(self, parameter_list: Sequence[Parameter]) -> Any:
        """Set parameters one by one."""
        return super().set_parameters([self.convert(one) for one in parameter_list])

    def set_parameters_atomically(self, parameter_list: Sequence[Parameter]) -> Any:
        """Set all of these parameters or none."""
        return super().set_parameters_atomically([self.convert(one) for one in parameter_list])


_ILLEGAL = re.compile(r"[^\w~/{}]", re.ASCII)
_DIGIT_FIRST = re.compile(r"(?:^|(?<=/))(?=\d)")
_THREADS = 4
OF_ROS = ("use_sim_time", "start_type_description_service", "qos_overrides.")
"""Beginnings of the names of parameters that ROS 2 itself gives to nodes."""
_END_S = 0.5

H = TypeVar("H", bound=Handle)

log = logging.getLogger(__name__)


class Ros2Session:
    """A node, with threads that answer its services.

    Args:
        name: of the node, unless the command line gives it another one.
        args: the command line, with what ROS takes from it.

    Raises:
        UsageError: ROS 2 does not understand the command line, or the node's name.
    """

    def __init__(self, name: str, args: list[str]) -> None:
        configure_cyclone()
        self._context = Context()
        with translated(name, UsageError, ""):
            rclpy.init(
                args=args, context=self._context, signal_handler_options=SignalHandlerOptions.NO
            )
            self.node = GraphNode(name, context=self._context)
        self._executor = MultiThreadedExecutor(_THREADS, context=self._context)
        self._executor.add_node(self.node)
        self._open: WeakSet[Any] = WeakSet()
        self._threads: WeakSet[threading.Thread] = WeakSet()
        self._ended = False
        self.start("callbacks", self._spin, again_s=0)

    @property
    def context(self) -> Context:
        """The node's context."""
        return self._context

    @property
    def is_over(self) -> bool:
        """True if the node has left the graph."""
        return self._ended or not self._context.ok()

    def keep(self, handle: H) -> H:
        """Have something closed when the node ends, if it is still there."""
        self._open.add(handle)
        return handle

    def manage(self, managed: Managed) -> Lifecycle:
        """Offer the services of a managed node."""
        lifecycle = Lifecycle(self.node, managed)
        self._executor.wake()
        return lifecycle

    def start(
        self, name: str, run: Callable[[], None], again_s: float | None = None
    ) -> threading.Thread:
        """Run something on a thread of its own, which is waited for when the node ends.

        Args:
            name: of the thread.
            run: returns soon after the node has left the graph.
            again_s: as of `ros_visualise.core.supervision.start`.
        """
        thread = supervision.start(name, partial(self._run, run), again_s)
        self._threads.add(thread)
        return thread

    def _run(self, run: Callable[[], None]) -> None:
        """Run something; that it fails as the node leaves the graph is no failure of its own."""
        try:
            run()
        except Exception:
            if not self.is_over:
                raise

    def end(self) -> None:
        """Leave the graph; more than once does no harm."""
        if self._ended:
            return
        for handle in tuple(self._open):
            supervision.attempt("end", handle.close)
        self._ended = True
        self._executor.shutdown(timeout_sec=_END_S)
        end_s = time.monotonic() + _END_S
        for thread in tuple(self._threads):  # one that waits in C++ when Python ends, ends badly
            thread.join(max(end_s - time.monotonic(), 0))
        self.node.destroy_node()
        self._context.try_shutdown()

    def option(self, name: str, default: Any) -> Any:
        """A parameter that is read once."""
        given = self.given()
        return given.get(name.replace("/", "."), default)

    def given(self, namespace: str = "") -> dict[str, Any]:
        """Values of parameters below a namespace from launch files and the command line."""
        prefix = f"{namespace}." if namespace else ""
        return {
            name.removeprefix(prefix): one.value
            for name, one in self.node._parameter_overrides.items()
            if name.startswith(prefix) and not name.startswith(OF_ROS)
        }

    def resolve(self, name: str) -> str:
        """The full name of a topic or service, remapped; that of the node itself for ``~``.

        Raises:
            UsageError: the name is invalid.
        """
        if name == "~":
            return str(self.node.get_fully_qualified_name())
        with translated(name, UsageError, "invalid topic name {}: "):
            return str(self.node.resolve_topic_name(spelled(name)))

    def _spin(self) -> None:
        """Answer until the node ends; after a callback that failed, the next one is called.

        What another thread closes as rclpy begins to wait for it is nothing to wait for any more.
        """
        while not self.is_over:
            with suppress(rclpy_implementation.InvalidHandle):
                self._executor.spin()


@cache
def spelled(name: str) -> str:
    """A name that ROS 2 accepts; recorded ones may have letters that it rejects."""
    if name.startswith("~"):
        name = f"~/{name[1:].lstrip('/')}"
    legal = _DIGIT_FIRST.sub("_", _ILLEGAL.sub("_", name))
    if legal != name:
        log.warning("%s renamed to %s: invalid ROS 2 name", name, legal)
    return legal
