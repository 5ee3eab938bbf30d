"""Quality of service: how the messages of a topic are kept and delivered."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class QoS:
    """The policies of a publisher, in the terms of ROS 2; the defaults are those of ROS 2.

    ROS 1 knows two of them: its topics are reliable, and a latched one is transient local with a
    depth of one.

    Attributes:
        depth: how many of the last messages are kept.
        reliable: a message that was lost on the way is sent again; else it is best effort.
        transient_local: whoever subscribes late gets the messages that are kept; else durability is
            volatile.
    """

    depth: int = 10
    reliable: bool = True
    transient_local: bool = False


VOLATILE = QoS()
"""Whoever subscribes gets what is published from then on."""

LATCHED = QoS(depth=1, transient_local=True)
"""Whoever subscribes late gets the last message."""
