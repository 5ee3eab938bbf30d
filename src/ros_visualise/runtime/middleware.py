"""The seam between our nodes and a middleware, such as a ROS graph: all that is asked of one.

``runtime/bridge`` joins a graph of this process to the topics around it, and ``runtime/remote``
looks at nodes elsewhere, by these methods alone. A middleware lives in a folder of its own beside
this file, and what it needs is imported there alone.

What the library of a middleware raises stays in that folder: one place there makes of it

- UsageError         a name or a type that the middleware cannot have
- OpenError          a file or a package that is missing
- DamagedMessage     a message, or the type of a recording, that it cannot hold
- ParameterError     a value that the node refuses
- Unreachable        nobody answers at the moment; asking again may help
- RosVisualiseError  the answer is an error; the base of all these

Anything else that a method raises is a bug. What is called from here, as ``take``, may raise
anything: that is noted (see `ros_visualise.core.supervision`) and costs that one message or call.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from ros_visualise.core.params import Parameters
from ros_visualise.core.rate import Clock
from ros_visualise.data import CameraInfo
from ros_visualise.messages.recorded import TopicType
from ros_visualise.nodes import NodeType, SourceType


class Handle(Protocol):
    """Something that is offered or listened to until it is closed."""

    def close(self) -> None:
        """End it; more than once does no harm."""


class Publisher(Handle, Protocol):
    """One topic that this process publishes. Publishing waits for no subscriber."""

    @property
    def name(self) -> str:
        """The topic's full name on the graph."""

    @property
    def connections(self) -> int:
        """How many subscribers there are."""

    @property
    def dropped(self) -> int:
        """Messages that a subscriber had no time for, over all subscribers."""

    def publish(self, message: Any) -> None:
        """Send a message: one of `ros_visualise.data`, or a recorded one as it stands.

        What it holds must not change any more.

        Raises:
            DamagedMessage: it cannot be sent, as one with a stamp before 1970.
        """

    def flush(self, timeout_s: float) -> None:
        """Wait until everybody who reads on has been sent the last message."""

    def wait_for_room(self, timeout_s: float) -> None:
        """Wait until there is a subscriber, or none at all, with no message waiting for it."""


class Subscriber(Handle, Protocol):
    """One topic that this process listens to."""

    @property
    def dropped(self) -> int:
        """Messages that were skipped for newer ones before they were taken."""


class Listing(NamedTuple):
    """What a graph holds at one moment, by full names.

    Attributes:
        publishers: topic and the nodes that publish it.
        subscribers: topic and the nodes that subscribe to it.
        types: topic -> its type, such as ``sensor_msgs/msg/Image``.
        parameters: node -> the names under which it has live parameters: its own, ``/pipeline``,
            and those of the nodes that share its process, such as ``/pipeline/filters``.
        onlookers: nodes that only look on, such as rviz.
    """

    publishers: Sequence[tuple[str, Sequence[str]]]
    subscribers: Sequence[tuple[str, Sequence[str]]]
    types: Mapping[str, str]
    parameters: Mapping[str, Sequence[str]]
    onlookers: Collection[str]


class ParametersListener(Protocol):
    """Who is told of the live parameters of a node elsewhere."""

    def declared(self, params: type, node: NodeType | SourceType | None) -> None:
        """The node has these parameters.

        Args:
            params: a dataclass of them: our own node's, or one that was made for the node.
            node: our own node, if it is one: see `ros_visualise.runtime.playing.offered`.
        """

    def told(self, values: Mapping[str, Any]) -> None:
        """The node has these values now; comes after `declared`."""


class ParametersClient(Handle, Protocol):
    """The live parameters of a node elsewhere on the graph."""

    @property
    def is_there(self) -> bool:
        """Whether the node is connected."""

    def set(self, values: Mapping[str, Any]) -> Mapping[str, Any]:
        """Have the node take over all values or none; its values after that.

        Raises:
            ParameterError: the node refuses.
            Unreachable: it does not answer.
        """


class Managed(Protocol):
    """A node that another one takes through the states of ROS 2's managed nodes.

    The calls come one at a time, in the order that the states allow. Each returns when it is done.

    Raises:
        RosVisualiseError: it cannot be done; the node stays in the state that it was in.
    """

    def configure(self) -> None:
        """Open all that is needed, and process nothing yet."""

    def activate(self) -> None:
        """Process messages from now on."""

    def deactivate(self) -> None:
        """Process none, and keep what is known."""

    def cleanup(self) -> None:
        """Close all that `configure` has opened, if anything is open; called at the end, too."""


class Middleware(Protocol):
    """What carries messages between processes.

    Names may be relative to the node's namespace, ``odom``, or to its own name, ``~clear``; they
    are remapped as the node was told to. All methods may be called from any thread.

    Attributes:
        flag: how a person gives a private parameter: its name and its value go in.
    """

    flag: str

    def begin(self, name: str) -> None:
        """Become a node of the graph, and send what this package logs to the graph's log.

        From then on Ctrl-C and SIGTERM interrupt nothing: they are noted for `is_over`, see
        `ros_visualise.core.signals.note`.

        Args:
            name: of the node, unless the command line gives it another one.
        """

    def end(self, reason: str) -> None:
        """Leave the graph; what is still offered or listened to ends, too."""

    def is_over(self) -> bool:
        """Whether this node has to end: it was asked to, or the graph wants it to."""

    def arguments(self) -> list[str]:
        """What stands on the command line beside remappings and parameters; before `begin`, too."""

    def option(self, name: str, default: Any) -> Any:
        """A private parameter that is read once, of the type that it was written as.

        Who does not know its type before makes do with text: ``8080`` may be an int or a str.
        """

    def starting_values(
        self, params: type, namespace: str = "", known: Iterable[str] = ()
    ) -> dict[str, Any]:
        """The values that launch files and the command line gave to declared parameters.

        Args:
            params: the dataclass that declares them.
            namespace: below the node's private one.
            known: other names that may stand there; any more are worth a warning.

        Raises:
            ParameterError: a value is of the wrong type or out of its range.
        """

    def find_file(self, url: str) -> str:
        """The path of ``package://PACKAGE/FILE``; other texts as they are.

        Raises:
            OpenError: there is no such package.
        """

    def resolve(self, name: str) -> str:
        """The full name on the graph of a topic or a service; for ``~`` that of the node itself."""

    def advertise(self, topic: str, type: TopicType) -> Publisher:
        """Publish a topic, with the type's quality of service.

        Args:
            topic: its name.
            type: of what is published: messages of `ros_visualise.data`, or, where it has
                ``definitions``, recorded ones. `ros_visualise.sinks.encoding.Encoder` makes bytes
                of both.

        Raises:
            UsageError: the middleware has no such type of messages.
            DamagedMessage: it cannot hold this type, which comes from a recording.
        """

    def subscribe(
        self,
        topic: str,
        kind: type,
        take: Callable[[Any], None],
        refuse: Callable[[str], None],
    ) -> Subscriber:
        """Listen to a topic, whatever quality of service its publishers offer.

        What publishers keep for those who come late comes first.

        ``take`` and ``refuse`` are called one after the other on a thread that this subscription
        has for itself. They may wait there, also for a message of another subscription; the
        publisher may have to wait meanwhile, or the middleware drops the oldest messages.

        Args:
            topic: its name; its publishers may come later.
            kind: the class of ours that its messages become, by
                `ros_visualise.messages.from_message`.
            take: gets each message.
            refuse: is told why a message is left out that contradicts itself.

        Raises:
            UsageError: the middleware has no such type of messages.
        """

    def offer(self, service: str, act: Callable[[], str | None]) -> Handle:
        """Offer a std_srvs/Trigger.

        Args:
            service: its name.
            act: is run, which may take long, and by several threads at once. What it returns is the
                answer's message; a `RosVisualiseError` becomes an answer without success.
        """

    def offer_calibration(self, service: str, take: Callable[[CameraInfo], None]) -> Handle:
        """Offer a sensor_msgs/SetCameraInfo, as `offer`; ``take`` gets what is to be set."""

    def manage(self, managed: Managed) -> Handle:
        """Have this node taken through its states by others, from the unconfigured one on.

        Raises:
            UsageError: the middleware has no managed nodes.
        """

    def call(self, service: str) -> None:
        """Call a std_srvs/Trigger, by its full name, and wait for the answer.

        Raises:
            RosVisualiseError: it cannot be asked, or has answered that it did not.
        """

    def serve_parameters(self, parameters: Parameters[Any], namespace: str) -> Handle:
        """Offer a node's live parameters to the graph.

        They are declared by ``ros_visualise.core.params.specs(parameters.current)``. A request is
        applied by ``parameters.update``, and refused if that raises; what changes here, the graph
        is told, see ``parameters.on_change``, whose listeners must not wait.

        Args:
            parameters: what is offered.
            namespace: below the node's private one, for several nodes in one process.
        """

    def follow_parameters(self, node: str, listener: ParametersListener) -> ParametersClient:
        """Follow the live parameters of a node elsewhere, also when it ends and comes back.

        Args:
            node: the name under which it has them, of `Listing.parameters`.
            listener: is told of them on threads of the middleware's.
        """

    def look(self) -> Listing:
        """What the graph holds now; asked twice a second, so it should not wait for other nodes.

        Raises:
            Unreachable: nobody can be asked at the moment.
        """

    def clock(self) -> Clock:
        """The graph's time: simulated where that is used, else the time of day."""

    def publish_clock(self, now_ns: Callable[[], int]) -> Handle:
        """Tell the graph the time, from now on, a hundred times a second."""
