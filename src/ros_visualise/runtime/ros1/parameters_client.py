"""The live parameters of a node in another process, over dynamic_reconfigure."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import rospy
from dynamic_reconfigure.msg import Config, ConfigDescription
from dynamic_reconfigure.srv import Reconfigure

from ros_visualise.core.errors import ParameterError, RosVisualiseError, Unreachable
from ros_visualise.core.params import specs
from ros_visualise.core.supervision import attempt
from ros_visualise.runtime.middleware import ParametersListener
from ros_visualise.runtime.ros1.declaration import Ros1Declaration, declare, our_own
from ros_visualise.runtime.ros1.errors import translated


class ReconfigureClient:
    """Follows a node's parameters; see `ros_visualise.runtime.middleware.ParametersClient`.

    Args:
        node: where dynamic_reconfigure has them, such as ``/edge_detector``.
        listener: is told of them.
    """

    def __init__(self, node: str, listener: ParametersListener) -> None:
        our_own()  # is needed soon, by threads that must not wait for it
        self._node = node
        self._listener = listener
        self._declaration: Ros1Declaration | None = None
        self._description: ConfigDescription | None = None
        self._last: Config | None = None
        self._lock = threading.RLock()
        self._descriptions = rospy.Subscriber(
            f"{node}/parameter_descriptions", ConfigDescription, self._calling(self._described)
        )
        self._updates = rospy.Subscriber(
            f"{node}/parameter_updates", Config, self._calling(self._updated)
        )

    @property
    def connected(self) -> bool:
        """True while the node is connected."""
        return bool(self._updates.get_num_connections())

    def set(self, values: Mapping[str, Any]) -> Mapping[str, Any]:
        """Have the node take over values.

        Raises:
            ParameterError: the node refuses.
            Unreachable: it does not answer.
        """
        declaration = self._declaration
        if declaration is None:
            raise Unreachable("its parameters are not known yet")
        config = declaration.encode(specs(declaration.params), values)
        try:
            with translated(self._node):
                service = rospy.ServiceProxy(f"{self._node}/set_parameters", Reconfigure)
                answer = service(config)
        except Unreachable:
            raise
        except RosVisualiseError as error:
            raise ParameterError(str(error)) from error
        return declaration.decode(answer.config)

    def close(self) -> None:
        """Follow them no longer."""
        self._descriptions.unregister()
        self._updates.unregister()

    def _calling(self, take: Callable[[Any], None]) -> Callable[[Any], object]:
        return lambda message: attempt(self._node, partial(take, message))

    def _described(self, description: ConfigDescription) -> None:
        with self._lock:
            if description == self._description:
                return
            self._description = description
            self._declaration = declare(description)
            self._listener.declared(self._declaration.params, self._declaration.node)
            if self._last is not None:
                self._updated(self._last)

    def _updated(self, config: Config) -> None:
        with self._lock:
            self._last = config
            if self._declaration is not None:
                self._listener.updated(self._declaration.decode(config))
