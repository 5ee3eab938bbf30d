"""Quality of service of topics."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class QoS:
    """The policies of a publisher, in the terms of ROS 2; the defaults are those of ROS 2.

    ROS 1 knows two of them: its topics are reliable, and a latched one is transient local with a
    depth of one.

    Attributes:
        depth: number of messages to keep.
        reliable: lost messages are sent again; else best effort.
        transient_local: late subscribers get the kept messages; else volatile.
    """

    depth: int = 10
    reliable: bool = True
    transient_local: bool = False


VOLATILE = QoS()
"""New subscribers get messages from then on."""

LATCHED = QoS(depth=1, transient_local=True)
"""Late subscribers get the last message."""
