"""Builder of graphs: vehicles beside the other nodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ros_visualise.core.errors import UsageError
from ros_visualise.data import PoseWithCovarianceStamped
from ros_visualise.estimation.landing.relative import Autopilot
from ros_visualise.graph import SOURCE_TOPICS, Graph, Node, place
from ros_visualise.links.wires import parse, split_system
from ros_visualise.nodes import find_node
from ros_visualise.simulation.robots import ROBOTS

_AUTOPILOT, _SIMULATED = "autopilot", "mavlink_vehicle"
_MEASURED = ("odom", "imu", "fix")
_GUIDANCE = {"landing_target": "/landing_target", "pose": SOURCE_TOPICS["estimate"]}


def with_vehicles(graph: Graph, addresses: Sequence[str]) -> Graph:
    """The same graph with a node `autopilot` for each address; further ones are numbered.

    Raises:
        UsageError: not an address, or one that is given twice.
    """
    is_simulated = graph.source is not None and graph.source.name in ROBOTS.names()
    own = [
        address
        for node in graph.nodes
        if node.type.name == _SIMULATED
        for address in node.params.address.split()
    ]
    for number, address in enumerate(addresses, 1):
        line, system = split_system(address)
        if address in addresses[: number - 1]:
            raise UsageError(
                f"--mavlink {address}: given twice; add ?system=2 to follow another vehicle"
            )
        if line in own:
            raise UsageError(
                f"--mavlink {line}: --mavlink-vehicle uses the same address; give"
                " --mavlink-vehicle udpout://HOST:PORT instead"
            )
        node = _beside(graph, place(find_node(_AUTOPILOT), {}), number)
        settings = {"address": line, "system": system, "simulated": is_simulated}
        graph = graph.joined(node).configured({node.name: settings})
    return graph


def as_vehicle(graph: Graph, addresses: Sequence[str]) -> Graph:
    """The same graph; its robot is found as a MAVLink vehicle at these addresses, if any.

    Raises:
        UsageError: not an address, or the robot does not fly.
    """
    if not addresses:
        return graph
    for number, address in enumerate(addresses):
        parse(address)
        if address in addresses[:number]:
            raise UsageError(f"--mavlink-vehicle {address}: given twice")
    robot = graph.source
    if robot is None or "linear.z" not in robot.type.velocity_axes:
        raise UsageError(f"--mavlink-vehicle {addresses[0]}: needs a flying robot (quadrotor)")
    inputs = {port: robot.outputs[port] for port in _MEASURED if port in robot.outputs}
    node = place(find_node(_SIMULATED), inputs)
    return graph.joined(node).configured({node.name: {"address": " ".join(addresses)}})


def guiding_vehicles(graph: Graph) -> Graph:
    """The same graph; its vehicles get the landing targets and poses that its nodes make.

    Poses that are made from a vehicle's own odometry would come back to it as if measured: they
    are not sent. Targets that are made from it are given in its own local frame, exactly.
    """
    own = {topic for one in graph.nodes if one.type.name == _AUTOPILOT for topic in one.topics}
    made = {
        topic: spec
        for node in graph.nodes
        for topic, spec in node.topics.items()
        if topic != _GUIDANCE["pose"] or node.inputs.get("odometry") not in own
    }
    inputs = {
        port: topic
        for port, topic in _GUIDANCE.items()
        if topic in made and made[topic].type is PoseWithCovarianceStamped
    }
    nodes = (
        replace(node, inputs=inputs) if node.type.name == _AUTOPILOT else node
        for node in graph.nodes
    )
    graph = replace(graph, nodes=tuple(nodes))
    local = {
        node.name: {"autopilot": Autopilot.PX4}
        for node in graph.nodes
        if node.type.name == "landing_target" and node.inputs.get("odom") in own
    }
    return graph.configured(local)


def _beside(graph: Graph, node: Node, number: int) -> Node:
    """A vehicle with a name and topics of its own; the first one moves the frames, if any may."""
    name = node.name if number == 1 else f"{node.name}_{number}"
    outputs = {
        port: f"/{name}/{port}" if number > 1 or topic in graph.topics else topic
        for port, topic in node.outputs.items()
    }
    return replace(node, name=name, outputs=outputs)
