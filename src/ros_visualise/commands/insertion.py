"""A node that the command line adds to a graph."""

from __future__ import annotations

from typing import NamedTuple

from ros_visualise.errors import UsageError


class Insertion(NamedTuple):
    """A node, what it comes after, and topics for its inputs; None where it does not say."""

    node: str
    after: str | None
    topics: dict[str, str]


def parse_insertion(text: str) -> Insertion:
    """``NODE[@AFTER][,INPUT=TOPIC ...]``, with as many inputs as one wants to choose.

    NODE is as `ros_visualise.nodes.choose_node` takes it.

    Raises:
        UsageError: it is not of that form.
    """
    path, colon, rest = text.rpartition(":")
    name, *chosen = rest.split(",")
    name, _, after = name.partition("@")
    topics = dict(one.partition("=")[::2] for one in chosen)
    if not all(topics.values()) or len(topics) < len(chosen):
        raise UsageError(f"{text}: give a node as NODE, NODE@AFTER or NODE@AFTER,INPUT=/topic")
    return Insertion(path + colon + name, after or None, topics)
