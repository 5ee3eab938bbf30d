"""ROS 2 as a transport; see `ros_visualise.runtime.middleware.Transport`."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

from ros_visualise.core.params import Parameters
from ros_visualise.core.rate import Clock
from ros_visualise.data import CameraInfo
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.middleware import Listing, ParametersListener, Transport
from ros_visualise.runtime.ros2 import clock, publishers, services, session
from ros_visualise.runtime.ros2.errors import translated
from ros_visualise.runtime.ros2.listing import Look
from ros_visualise.runtime.ros2.parameters import ParameterDesk, Ros2ServedParameters
from ros_visualise.runtime.ros2.parameters_client import ParameterClient, ParameterEvents
from ros_visualise.runtime.ros2.publishers import Ros2Publisher, Unsent
from ros_visualise.runtime.ros2.services import Ros2Service
from ros_visualise.runtime.ros2.session import Ros2Session
from ros_visualise.runtime.ros2.subscriptions import Ros2Subscriber


class Ros2Transport(Transport):
    """The topics and services of a node.

    Args:
        session: the node.

    Attributes:
        session: the node.
        desk: answers for its parameters.
    """

    def __init__(self, session: Ros2Session) -> None:
        self.session = session
        self.desk = ParameterDesk(session)

    def close(self) -> None:
        """Leave the graph."""
        self.session.end()

    def resolve(self, name: str) -> str:
        """A topic's full name on the graph."""
        return self.session.resolve(name)

    @translated("the ROS 2 graph")
    def advertise(self, topic: str, type: TopicType) -> Ros2Publisher | Unsent:
        """Publish a topic."""
        return self.session.keep(publishers.advertise(self.session, topic, type))

    @translated("the ROS 2 graph")
    def subscribe(
        self, topic: str, kind: type, take: Callable[[Any], None], reject: Callable[[str], None]
    ) -> Ros2Subscriber:
        """Subscribe to a topic."""
        return self.session.keep(Ros2Subscriber(self.session, topic, kind, take, reject))

    @translated("the ROS 2 graph")
    def offer(self, action: str, act: Callable[[], str | None]) -> Ros2Service:
        """Offer a std_srvs/Trigger."""
        return services.trigger(self.session.node, session.spelled(action), act)

    @translated("the ROS 2 graph")
    def offer_calibration(self, service: str, take: Callable[[CameraInfo], None]) -> Ros2Service:
        """Offer a sensor_msgs/SetCameraInfo."""
        return services.set_camera_info(self.session.node, session.spelled(service), take)

    def call(self, action: str) -> None:
        """Call a std_srvs/Trigger."""
        with translated(action):
            services.call(self.session.node, action)

    def serve_parameters(self, parameters: Parameters[Any], namespace: str) -> Ros2ServedParameters:
        """Declare a node's parameters."""
        return self.desk.serve(parameters, namespace)

    def follow_parameters(self, node: str, listener: ParametersListener) -> ParameterClient:
        """Follow a node's parameters."""
        name, prefix = self._events.where(node)
        return self.session.keep(ParameterClient(self._events, name, prefix, listener))

    @translated("the ROS 2 graph")
    def listing(self) -> Listing:
        """The graph as it is known here by now."""
        return self._look()

    def clock(self) -> Clock:
        """Simulated time where ``use_sim_time`` is set, else the time of day."""
        return clock.ros_clock(self.session.node)

    @cached_property
    def _events(self) -> ParameterEvents:
        return ParameterEvents(self.session)

    @cached_property
    def _look(self) -> Look:
        return Look(self.session.node, self._events)
