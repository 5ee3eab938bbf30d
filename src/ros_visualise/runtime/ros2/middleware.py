"""ROS 2 as a middleware; see `ros_visualise.runtime.middleware.Middleware`."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from functools import cached_property, partial
from typing import Any

from ros_visualise.core.params import Parameters
from ros_visualise.core.rate import Clock
from ros_visualise.core.signals import Wish, note
from ros_visualise.data import CameraInfo
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.bridge.given import given_values
from ros_visualise.runtime.bridge.logged import log_to
from ros_visualise.runtime.middleware import Handle, Listing, Managed, ParametersListener
from ros_visualise.runtime.ros2 import clock, publishers, services, session
from ros_visualise.runtime.ros2.clock import ClockPublisher
from ros_visualise.runtime.ros2.errors import asking
from ros_visualise.runtime.ros2.listing import Look
from ros_visualise.runtime.ros2.parameters import ParameterDesk, ServedParameters
from ros_visualise.runtime.ros2.parameters_client import ParameterClient, ParameterEvents
from ros_visualise.runtime.ros2.publishers import Publisher, Unsent
from ros_visualise.runtime.ros2.services import Service
from ros_visualise.runtime.ros2.session import Session
from ros_visualise.runtime.ros2.subscriptions import Subscriber


class Ros2:
    """The ROS 2 graph of ``ROS_DOMAIN_ID``, with this process as a node."""

    flag = "{0}:={1} (of an executable: --ros-args -p {0}:={1})"

    def __init__(self) -> None:
        self._wish = Wish()
        self._session: Session | None = None

    def begin(self, name: str) -> None:
        """Become a node."""
        note(self._wish)  # who leaves while he joins would be seen for another ten seconds
        self.join(name, sys.argv)
        log_to(session.say_on(self.session.node))
        watch = partial(clock.watch_clock, self.session.node, self.is_over)
        self.session.start(watch, "clock watch")

    def join(self, name: str, args: list[str]) -> None:
        """Become a node, and nothing else: signals and what is logged stay as they are."""
        self._session = Session(name, args)

    @property
    def session(self) -> Session:
        """This process on the graph."""
        assert self._session is not None, "begin comes first"
        return self._session

    def end(self, reason: str) -> None:
        """Leave the graph."""
        if self._session is not None:
            self._session.end()

    def is_over(self) -> bool:
        """Whether this node has to end."""
        return self._wish.asked or self.session.is_over

    def arguments(self) -> list[str]:
        """What stands on the command line beside what ROS takes from it."""
        return session.arguments()

    def option(self, name: str, default: Any) -> Any:
        """A parameter that is read once."""
        value = self.session.option(name, default)
        self._desk.show(name, value)
        return value

    def starting_values(
        self, params: type, namespace: str = "", known: Iterable[str] = ()
    ) -> dict[str, Any]:
        """The values that were given to declared parameters."""
        self._desk.expect(namespace)
        given = self.session.given(namespace)
        return given_values(params, given, known, f"{namespace}.".lstrip("."))

    def find_file(self, url: str) -> str:
        """The path of ``package://PACKAGE/FILE``."""
        return session.find_file(url)

    def resolve(self, name: str) -> str:
        """A topic's full name on the graph."""
        return self.session.resolve(name)

    def advertise(self, topic: str, type: TopicType) -> Publisher | Unsent:
        """Publish a topic."""
        return self.session.keep(publishers.advertise(self.session, topic, type))

    def subscribe(
        self, topic: str, kind: type, take: Callable[[Any], None], refuse: Callable[[str], None]
    ) -> Subscriber:
        """Listen to a topic."""
        return self.session.keep(Subscriber(self.session, topic, kind, take, refuse))

    def offer(self, service: str, act: Callable[[], str | None]) -> Service:
        """Offer a std_srvs/Trigger."""
        return services.trigger(self.session.node, session.spelled(service), act)

    def offer_calibration(self, service: str, take: Callable[[CameraInfo], None]) -> Service:
        """Offer a sensor_msgs/SetCameraInfo."""
        return services.set_camera_info(self.session.node, session.spelled(service), take)

    def manage(self, managed: Managed) -> Handle:
        """Have this node taken through the states of a managed node."""
        return self.session.manage(managed)

    def call(self, service: str) -> None:
        """Call a std_srvs/Trigger."""
        with asking(service):
            services.call(self.session.node, service)

    def serve_parameters(self, parameters: Parameters[Any], namespace: str) -> ServedParameters:
        """Declare a node's parameters."""
        return self._desk.serve(parameters, namespace)

    def follow_parameters(self, node: str, listener: ParametersListener) -> ParameterClient:
        """Follow a node's parameters."""
        name, prefix = self._events.where(node)
        return self.session.keep(ParameterClient(self._events, name, prefix, listener))

    def look(self) -> Listing:
        """What is known of the graph."""
        with asking("the ROS 2 graph"):
            return self._look()

    def clock(self) -> Clock:
        """Simulated time where ``use_sim_time`` is set, else the time of day."""
        return clock.ros_clock(self.session.node)

    def publish_clock(self, now_ns: Callable[[], int]) -> ClockPublisher:
        """Publish ``/clock``."""
        return self.session.keep(ClockPublisher(self.session, now_ns))

    @cached_property
    def _desk(self) -> ParameterDesk:
        return ParameterDesk(self.session)

    @cached_property
    def _events(self) -> ParameterEvents:
        return ParameterEvents(self.session)

    @cached_property
    def _look(self) -> Look:
        return Look(self.session.node, self._events)
