"""Quality of service of ROS 2 topics."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSCompatibility,
    QoSPolicyKind,
    QoSProfile,
    ReliabilityPolicy,
    qos_check_compatible,
)
from rclpy.qos_overriding_options import QoSOverridingOptions

from ros_visualise.core.errors import UsageError
from ros_visualise.messages.qos import QoS

_RELIABLE = {True: ReliabilityPolicy.RELIABLE, False: ReliabilityPolicy.BEST_EFFORT}
_LOCAL = {True: DurabilityPolicy.TRANSIENT_LOCAL, False: DurabilityPolicy.VOLATILE}

_OVERRIDDEN = (
    *(QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH),
    *(QoSPolicyKind.RELIABILITY, QoSPolicyKind.DURABILITY),
)

_UNKNOWN = ("_NODE_NAME_UNKNOWN_", "_CREATED_BY_BARE_DDS_APP_")
"""Names that RMWs give to nodes whose names are unknown."""


def profile(qos: QoS) -> QoSProfile:
    """The same policies in rclpy's terms."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=max(qos.depth, 1),
        reliability=_RELIABLE[qos.reliable],
        durability=_LOCAL[qos.transient_local],
    )


@contextmanager
def overridden(node: Node, topic: str, end: str) -> Iterator[QoSOverridingOptions | None]:
    """The options ``qos_overrides.TOPIC.END.POLICY``, to create that end with.

    Args:
        node: of this process.
        topic: its full name.
        end: ``publisher`` or ``subscription``.

    Raises:
        UsageError: it is no such policy, or of the wrong type.
    """
    prefix = f"qos_overrides.{topic}.{end}."
    is_given = any(name.startswith(prefix) for name in node._parameter_overrides)
    try:
        yield QoSOverridingOptions(_OVERRIDDEN) if is_given else None
    except (ParameterException, RuntimeError, AttributeError) as error:
        if not is_given:
            raise
        raise UsageError(f"{prefix}*: {error}") from None


def fitting(offered: Sequence[QoSProfile], depth: int) -> QoS:
    """The most that can be asked of all of these publishers.

    Args:
        offered: by each publisher of a topic.
        depth: how many messages may wait.
    """
    return QoS(
        depth,
        reliable=all(one.reliability == ReliabilityPolicy.RELIABLE for one in offered),
        transient_local=all(one.durability == DurabilityPolicy.TRANSIENT_LOCAL for one in offered),
    )


def clash(publisher: Any, subscriber: Any) -> str | None:
    """Why a subscriber gets nothing from a publisher, with both named; None where it does.

    Args:
        publisher, subscriber: of one topic, as ``get_publishers_info_by_topic`` has them.
    """
    offers, asks = publisher.qos_profile, subscriber.qos_profile
    fits, _ = qos_check_compatible(offers, asks)
    if fits != QoSCompatibility.ERROR:
        return None
    reasons = [
        f"{full_name(subscriber)} requests {_word(getattr(asks, policy))}, but"
        f" {full_name(publisher)} offers {_word(getattr(offers, policy))}"
        for policy in ("reliability", "durability", "liveliness")
        if _is_less(getattr(offers, policy), getattr(asks, policy))
    ]
    return (
        "; ".join(reasons) or f"the deadlines of {full_name(publisher)} and {full_name(subscriber)}"
    )


def full_name(end: Any) -> str:
    """The full name of the node that a publisher or subscriber belongs to."""
    if not is_named(end):
        return "unnamed endpoint"
    return f"{end.node_namespace.rstrip('/')}/{end.node_name}"


def is_named(end: Any) -> bool:
    """True if it is known which node a publisher or subscriber belongs to."""
    return end.node_name not in _UNKNOWN


def _is_less(offered: Any, asked: Any) -> bool:
    """True if a policy is weaker than another: all of them are numbered from the strongest on."""
    strong = {ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL}
    return offered != asked and (asked in strong or "MANUAL" in asked.name)


def _word(policy: Any) -> str:
    return str(policy.name).lower().replace("_", " ")
