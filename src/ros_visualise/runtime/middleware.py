"""The seam between our nodes and a middleware, such as a ROS graph: all that is asked of one.

A middleware is two things, each in a class of its own:

- `Host`       how a process begins on it: its name, arguments, options, files, log and end
- `Transport`  what joins processes: topics, actions, live parameters, time, and who is there

``runtime/bridge`` joins a graph of this process to the topics around it, and ``runtime/remote``
shows nodes elsewhere, by the transport alone. Where the command line starts a process there is no
host: a new middleware is a transport. It has a folder of its own beside this file, which alone
imports its library.

What the library raises stays in that folder: its ``errors.py`` has one context manager,
``translated``, within which the library is called, and which raises instead

- UsageError         a name or a type that the middleware cannot have
- OpenError          a file or a package that is missing, an address that cannot be used
- DamagedMessage     a message, or the type of a recording, that it cannot hold
- ParameterError     a value that the node refuses
- Unreachable        no answer at the moment, or this process has left; asking again may help
- RosVisualiseError  the answer is an error; the base of all these

Methods name those that they raise; any other error is a bug. What is called from here, as ``take``,
may raise anything: that is noted (see `ros_visualise.core.supervision`) and costs that one message
or call. ``tests/contract_of_faults.py`` holds every transport to this.
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
    """Something that is offered or subscribed to until it is closed."""

    def close(self) -> None:
        """End it; more than once does no harm."""


class Publisher(Handle, Protocol):
    """One topic that this process publishes. Publishing waits for no subscriber."""

    @property
    def name(self) -> str:
        """The topic's full name."""

    @property
    def connections(self) -> int:
        """The number of subscribers; 0 after `close`."""

    @property
    def dropped(self) -> int:
        """Messages that a subscriber had no time for, over all subscribers."""

    def publish(self, message: Any) -> None:
        """Send a message: one of `ros_visualise.data`, or an undecoded one of a recording.

        Its arrays must not change any more. After `close` it goes to nobody.

        Raises:
            DamagedMessage: it cannot be sent, as one with a stamp before 1970.
        """

    def flush(self, timeout_s: float) -> None:
        """Wait until everybody who reads on has been sent the last message."""

    def wait_for_room(self, timeout_s: float) -> None:
        """Wait until there is a subscriber, or none at all, with no message waiting for it."""


class Subscriber(Handle, Protocol):
    """One topic that this process subscribes to."""

    @property
    def dropped(self) -> int:
        """Messages that were skipped for newer ones before they were taken."""


class Listing(NamedTuple):
    """The nodes and topics of a graph at one moment, by full names.

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
    """Receives the live parameters of a node elsewhere."""

    def declared(self, params: type, node: NodeType | SourceType | None) -> None:
        """The node has these parameters.

        Args:
            params: a dataclass of them: our own node's, or one that was made for the node.
            node: our own node, if it is one: see `ros_visualise.runtime.playing.offered`.
        """

    def updated(self, values: Mapping[str, Any]) -> None:
        """The node has these values now; comes after `declared`."""


class ParametersClient(Handle, Protocol):
    """The live parameters of a node elsewhere on the graph."""

    @property
    def connected(self) -> bool:
        """True while the node is on the graph."""

    def set(self, values: Mapping[str, Any]) -> Mapping[str, Any]:
        """Have the node take over all values or none; its values after that.

        Raises:
            ParameterError: the node refuses.
            Unreachable: it does not answer.
        """


class Managed(Protocol):
    """A node whose states another one drives: unconfigured, inactive, active.

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


class Host(Protocol):
    """Start and end of a process that is a node of a graph. Safe to call from any thread.

    Attributes:
        flag: how a person gives an option: its name and its value go in.
    """

    flag: str

    def begin(self, name: str) -> Transport:
        """Become a node of the graph, and send what this package logs to the graph's log.

        From then on Ctrl-C and SIGTERM interrupt nothing: they are noted for `is_over`, see
        `ros_visualise.core.signals.note`.

        Args:
            name: of the node, unless the command line gives it another one.

        Raises:
            UsageError: the command line or the name is wrong.
        """

    def end(self) -> None:
        """Leave the graph and close the transport; more than once does no harm."""

    def is_over(self) -> bool:
        """True if this node has to end: it was asked to, or the graph wants it to."""

    def arguments(self) -> list[str]:
        """The command line without remappings and parameters; before `begin`, too."""

    def option(self, name: str, default: Any) -> Any:
        """A parameter of this process that is read once, of the type that it was written as.

        Text may come as a number: ``8080`` may be an int or a str.
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
            OpenError: no such package.
        """

    def manage(self, managed: Managed) -> Handle:
        """Let others drive this node through its states, from the unconfigured one on.

        Raises:
            UsageError: the middleware has no managed nodes.
        """


class Transport(Handle, Protocol):
    """Topics, actions, parameters and time, between this node and others.

    Names may be relative to the node's namespace, ``odom``, or to its own name, ``~clear``; they
    are remapped as the host was started. All methods may be called from any thread. After `close`,
    which ends all that is offered and subscribed to, they do nothing or raise Unreachable.
    """

    def resolve(self, name: str) -> str:
        """The full name of a topic or an action; for ``~`` that of the node itself.

        Raises:
            UsageError: the middleware cannot have this name.
        """

    def advertise(self, topic: str, type: TopicType) -> Publisher:
        """Publish a topic, with the type's quality of service.

        Args:
            topic: its name.
            type: of what is published: messages of `ros_visualise.data`, or, where it has
                ``definitions``, recorded ones. `ros_visualise.sinks.encoding.Encoder` makes bytes
                of both.

        Raises:
            UsageError: the middleware cannot have this name, or has no such type.
            DamagedMessage: it cannot hold this type, which comes from a recording.
        """

    def subscribe(
        self,
        topic: str,
        kind: type,
        take: Callable[[Any], None],
        reject: Callable[[str], None],
    ) -> Subscriber:
        """Subscribe to a topic, whatever quality of service its publishers offer.

        Latched messages come first. ``take`` and ``reject`` are called one after the other on a
        thread that this subscription has for itself. They may wait there, also for a message of
        another subscription; the publisher may have to wait meanwhile, or the middleware drops the
        oldest messages.

        Args:
            topic: its name; its publishers may come later.
            kind: the class of ours that its messages become, by
                `ros_visualise.messages.from_message`.
            take: gets each message.
            reject: gets the reason for each message that is dropped as it contradicts itself.

        Raises:
            UsageError: the middleware cannot have this name, or has no such type.
        """

    def offer(self, action: str, act: Callable[[], str | None]) -> Handle:
        """Offer an action, which others `call`.

        Args:
            action: its name.
            act: is run, which may take long, and by several threads at once. What it returns is the
                answer's text; `ros_visualise.runtime.bridge.services.answer` runs it.
        """

    def offer_calibration(self, service: str, take: Callable[[CameraInfo], None]) -> Handle:
        """Offer to store a camera's calibration, as `offer`; ``take`` gets the calibration."""

    def call(self, action: str) -> None:
        """Call an action, by its full name, and wait for the answer.

        Raises:
            Unreachable: it is not offered, or no answer comes.
            RosVisualiseError: the answer is that it failed, and why.
        """

    def serve_parameters(self, parameters: Parameters[Any], namespace: str) -> Handle:
        """Offer a node's live parameters to the graph.

        They are declared by ``ros_visualise.core.params.specs(parameters.current)``. A request is
        applied by ``parameters.update``, and refused if that raises; changes made here are
        published, see ``parameters.on_change``, whose listeners must not wait.

        Args:
            parameters: what is offered.
            namespace: below the node's private one, for several nodes in one process.
        """

    def follow_parameters(self, node: str, listener: ParametersListener) -> ParametersClient:
        """Follow the live parameters of a node elsewhere, also when it ends and comes back.

        Args:
            node: the name under which it has them, of `Listing.parameters`.
            listener: is called on threads of the middleware's.
        """

    def listing(self) -> Listing:
        """The graph as it is now; asked twice a second, so it should not wait for other nodes.

        Raises:
            Unreachable: the graph cannot be asked at the moment.
        """

    def clock(self) -> Clock:
        """The graph's time: simulated where that is used, else the time of day."""
