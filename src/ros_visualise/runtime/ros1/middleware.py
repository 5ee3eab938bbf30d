"""ROS 1 as a middleware; see `ros_visualise.runtime.middleware.Middleware`."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

from ros_visualise.core.errors import UsageError
from ros_visualise.core.params import Parameters
from ros_visualise.core.rate import Clock
from ros_visualise.core.supervision import attempt
from ros_visualise.data import CameraInfo
from ros_visualise.messages import from_message, type_name
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.middleware import Handle, Listing, Managed, ParametersListener
from ros_visualise.runtime.ros1 import clock, listing, publishers, reconfigure, services, session
from ros_visualise.runtime.ros1.clock import ClockPublisher
from ros_visualise.runtime.ros1.parameters_client import ReconfigureClient
from ros_visualise.runtime.ros1.reconfigure import ReconfigureServer
from ros_visualise.runtime.ros1.services import TriggerService
from ros_visualise.runtime.ros1.set_camera_info import SetCameraInfoService
from ros_visualise.runtime.ros1.transport import Publisher, Subscriber
from ros_visualise.runtime.ros1.types import message_class


class Ros1:
    """The ROS graph of the master that ``ROS_MASTER_URI`` names, with this process as a node."""

    flag = "{0}:={1} (of an executable: _{0}:={1})"

    def begin(self, name: str) -> None:
        """Become a node."""
        session.begin(name)

    def end(self, reason: str) -> None:
        """Leave the graph."""
        session.end(reason)

    def is_over(self) -> bool:
        """Whether this node has to end."""
        return session.is_over()

    def arguments(self) -> list[str]:
        """What stands on the command line beside remappings and private parameters."""
        return session.arguments()

    def option(self, name: str, default: Any) -> Any:
        """A private parameter that is read once."""
        return session.option(name, default)

    def starting_values(
        self, params: type, namespace: str = "", known: Iterable[str] = ()
    ) -> dict[str, Any]:
        """The values that were given to declared parameters."""
        return reconfigure.starting_values(params, namespace, known)

    def find_file(self, url: str) -> str:
        """The path of ``package://PACKAGE/FILE``."""
        return session.find_file(url)

    def resolve(self, name: str) -> str:
        """A topic's full name on the graph."""
        return session.resolve(name)

    def advertise(self, topic: str, type: TopicType) -> Publisher:
        """Publish a topic."""
        return publishers.advertise(topic, type)

    def subscribe(
        self, topic: str, kind: type, take: Callable[[Any], None], refuse: Callable[[str], None]
    ) -> Subscriber:
        """Listen to a topic."""

        def taken(message: Any) -> None:
            try:
                data: Any = from_message(message, kind)
            except ValueError as error:
                refuse(str(error))
            else:
                take(data)

        def heard(message: Any) -> None:
            attempt(self.resolve(topic), partial(taken, message))

        return Subscriber(topic, message_class(type_name(kind)), heard, refuse)

    def offer(self, service: str, act: Callable[[], str | None]) -> TriggerService:
        """Offer a std_srvs/Trigger."""
        return TriggerService(service, act)

    def offer_calibration(
        self, service: str, take: Callable[[CameraInfo], None]
    ) -> SetCameraInfoService:
        """Offer a sensor_msgs/SetCameraInfo."""
        return SetCameraInfoService(service, take)

    def manage(self, managed: Managed) -> Handle:
        """Refuse it."""
        raise UsageError("ROS 1 has no managed nodes; run it without managed")

    def call(self, service: str) -> None:
        """Call a std_srvs/Trigger."""
        services.call(service)

    def serve_parameters(self, parameters: Parameters[Any], namespace: str) -> ReconfigureServer:
        """Offer a node's parameters over dynamic_reconfigure."""
        return ReconfigureServer(parameters, namespace)

    def follow_parameters(self, node: str, listener: ParametersListener) -> ReconfigureClient:
        """Follow a node's parameters over dynamic_reconfigure."""
        return ReconfigureClient(node, listener)

    def look(self) -> Listing:
        """What the master knows."""
        return listing.look()

    def clock(self) -> Clock:
        """Simulated time where ``/use_sim_time`` is set, else the time of day."""
        return clock.ros_clock()

    def publish_clock(self, now_ns: Callable[[], int]) -> ClockPublisher:
        """Publish ``/clock``."""
        return ClockPublisher(now_ns)
