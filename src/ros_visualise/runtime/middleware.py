"""The interface between our nodes and a middleware, such as a ROS graph.

A middleware implements two classes:

- `Host`       life of a process: its name, arguments, options, files, log and end
- `Transport`  communication: topics, actions, live parameters, time, and the nodes of the graph

``runtime/bridge`` connects the graph of this process to topics of the middleware;
``runtime/remote`` shows remote nodes. Both use only the transport. A process that is started from
the command line needs no host, so a middleware may consist of a transport alone. Each middleware
has a folder beside this file, and only that folder imports its library.

The library's exceptions stay in that folder, too: ``errors.py`` has a context manager,
``translated``, around each call of the library, which raises instead

- UsageError         the middleware does not allow this name or type
- OpenError          a missing file or package, or an unusable address
- DamagedMessage     a message, or the type of a recording, that it cannot represent
- ParameterError     a value that the node rejects
- Unreachable        no answer, or this process has left the graph; a retry may help
- RosVisualiseError  the answer is an error; base class of all the above

Each method lists the errors that it raises; any other error is a bug. Callbacks such as ``take``
may raise anything: the error is logged (see `ros_visualise.core.supervision`) and costs only that
message or call. ``tests/contract_of_faults.py`` checks every transport against this.
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
        """Stop it; further calls have no effect."""


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
        """Messages dropped because a subscriber was too slow, over all subscribers."""

    def publish(self, message: Any) -> None:
        """Send a message: one of `ros_visualise.data`, or an undecoded one of a recording.

        Its arrays must not be modified afterwards. After `close` the message is discarded.

        Raises:
            DamagedMessage: it cannot be sent, for instance with a stamp before 1970.
        """

    def flush(self, timeout_s: float) -> None:
        """Wait until the last message was sent to every subscriber that still reads."""

    def wait_for_room(self, timeout_s: float) -> None:
        """Wait until a subscriber has no message pending, or there are no subscribers."""


class Subscriber(Handle, Protocol):
    """One topic that this process subscribes to."""

    @property
    def dropped(self) -> int:
        """Messages dropped for newer ones before they were taken."""


class Listing(NamedTuple):
    """The nodes and topics of a graph at one moment, by full names.

    Attributes:
        publishers: pairs of a topic and the nodes that publish it.
        subscribers: pairs of a topic and the nodes that subscribe to it.
        types: topic -> its type, such as ``sensor_msgs/msg/Image``.
        parameters: node -> the names under which it has live parameters: its own, ``/pipeline``,
            and those of the nodes that share its process, such as ``/pipeline/filters``.
        onlookers: nodes that only observe, such as rviz.
    """

    publishers: Sequence[tuple[str, Sequence[str]]]
    subscribers: Sequence[tuple[str, Sequence[str]]]
    types: Mapping[str, str]
    parameters: Mapping[str, Sequence[str]]
    onlookers: Collection[str]


class ParametersListener(Protocol):
    """Receives the live parameters of a remote node."""

    def declared(self, params: type, node: NodeType | SourceType | None) -> None:
        """Learn which parameters the node has.

        Args:
            params: their dataclass: that of our own node, or one generated for the remote node.
            node: our own node, if it is one; see `ros_visualise.runtime.playing.offered`.
        """

    def updated(self, values: Mapping[str, Any]) -> None:
        """Learn the current values; called after `declared`."""


class ParametersClient(Handle, Protocol):
    """The live parameters of a remote node."""

    @property
    def connected(self) -> bool:
        """True while the node is on the graph."""

    def set(self, values: Mapping[str, Any]) -> Mapping[str, Any]:
        """Set all values or none on the node; return its values afterwards.

        Raises:
            ParameterError: the node rejects a value.
            Unreachable: it does not answer.
        """


class Managed(Protocol):
    """A managed node, whose state another node controls: unconfigured, inactive or active.

    The methods are called one at a time, in the order that the states allow, and return when the
    transition is complete.

    Raises:
        RosVisualiseError: the transition failed; the node keeps its state.
    """

    def configure(self) -> None:
        """Open all resources, without processing anything yet."""

    def activate(self) -> None:
        """Start to process messages."""

    def deactivate(self) -> None:
        """Stop processing, and keep the nodes' state."""

    def cleanup(self) -> None:
        """Close everything that `configure` opened, if it is open; also called at the end."""


class Host(Protocol):
    """Life of a process that is a node of a graph; all methods may be called from any thread.

    Attributes:
        flag: format of an option on the command line, with places for its name and its value.
    """

    flag: str

    def begin(self, name: str) -> Transport:
        """Join the graph as a node, and forward this package's log to the graph's log.

        From then on Ctrl-C and SIGTERM raise no exception; `is_over` reports them, see
        `ros_visualise.core.signals.note`.

        Args:
            name: name of the node, unless the command line gives another one.

        Raises:
            UsageError: invalid command line or name.
        """

    def end(self) -> None:
        """Leave the graph and close the transport; further calls have no effect."""

    def is_over(self) -> bool:
        """True if this node has to end, by a stop request or because the graph shuts down."""

    def arguments(self) -> list[str]:
        """The command line without remappings and parameters; also valid before `begin`."""

    def option(self, name: str, default: Any) -> Any:
        """A parameter that is read once, at the start.

        Its type is the one it was written in, so a text such as ``8080`` may be an int.
        """

    def starting_values(
        self, params: type, namespace: str = "", known: Iterable[str] = ()
    ) -> dict[str, Any]:
        """Values of declared parameters from launch files and the command line.

        Args:
            params: the dataclass that declares them.
            namespace: namespace below the node's private one.
            known: other accepted names; any further name is logged as a warning.

        Raises:
            ParameterError: a value of the wrong type or out of range.
        """

    def find_file(self, url: str) -> str:
        """The path of a ``package://PACKAGE/FILE`` URL; any other text is returned unchanged.

        Raises:
            OpenError: no such package.
        """

    def manage(self, managed: Managed) -> Handle:
        """Let other nodes control the state of this node, which begins unconfigured.

        Raises:
            UsageError: the middleware has no managed nodes.
        """


class Transport(Handle, Protocol):
    """Topics, actions, parameters and time, shared with other nodes.

    Names may be relative to the node's namespace (``odom``) or to its own name (``~clear``), and
    are remapped by the host's command line. All methods may be called from any thread. `close` ends
    all publishers, subscribers and services; afterwards methods do nothing or raise Unreachable.
    """

    def resolve(self, name: str) -> str:
        """The full name of a topic or an action; ``~`` gives the name of the node.

        Raises:
            UsageError: the middleware cannot have this name.
        """

    def advertise(self, topic: str, type: TopicType) -> Publisher:
        """Publish a topic, with the type's quality of service.

        Args:
            topic: its name.
            type: type of the messages: of `ros_visualise.data`, or recorded ones if it has
                ``definitions``. `ros_visualise.sinks.encoding.Encoder` encodes both.

        Raises:
            UsageError: the middleware cannot have this name, or has no such type.
            DamagedMessage: it cannot represent this type of a recording.
        """

    def subscribe(
        self,
        topic: str,
        kind: type,
        take: Callable[[Any], None],
        reject: Callable[[str], None],
    ) -> Subscriber:
        """Subscribe to a topic, whatever quality of service its publishers offer.

        Latched messages come first. ``take`` and ``reject`` are called one at a time, on the
        subscription's own thread. They may block, even for a message of another subscription;
        meanwhile the publisher waits or the middleware drops the oldest messages.

        Args:
            topic: its name; publishers may come later.
            kind: our class to which messages are converted, by
                `ros_visualise.messages.from_message`.
            take: receives each message.
            reject: receives the reason for each inconsistent message, which is dropped.

        Raises:
            UsageError: the middleware cannot have this name, or has no such type.
        """

    def offer(self, action: str, act: Callable[[], str | None]) -> Handle:
        """Offer an action, for other nodes to `call`.

        Args:
            action: its name.
            act: runs the action and returns the text of the answer. It may take long, and may be
                called by several threads at once; `ros_visualise.runtime.bridge.services.answer`
                calls it.
        """

    def offer_calibration(self, service: str, take: Callable[[CameraInfo], None]) -> Handle:
        """Offer a service that sets a camera's calibration; ``take`` receives it."""

    def call(self, action: str) -> None:
        """Call an action by its full name, and wait for the answer.

        Raises:
            Unreachable: it is not offered, or does not answer.
            RosVisualiseError: it failed; the message is the answer's reason.
        """

    def serve_parameters(self, parameters: Parameters[Any], namespace: str) -> Handle:
        """Offer a node's live parameters to the graph.

        They are declared by ``ros_visualise.core.params.specs(parameters.current)``. A request is
        applied by ``parameters.update``, and rejected if that raises. Local changes are published
        through ``parameters.on_change``, whose listeners must not block.

        Args:
            parameters: the live parameters.
            namespace: namespace below the node's private one, for several nodes in one process.
        """

    def follow_parameters(self, node: str, listener: ParametersListener) -> ParametersClient:
        """Follow the live parameters of a remote node, across its restarts.

        Args:
            node: a name from `Listing.parameters`.
            listener: called on the middleware's threads.
        """

    def listing(self) -> Listing:
        """The current graph; called twice a second, so it should not wait for other nodes.

        Raises:
            Unreachable: the graph cannot be read at the moment.
        """

    def clock(self) -> Clock:
        """The graph's clock: simulated time if the graph uses it, else the wall clock."""
