"""Errors of Zenoh as errors of ours: the one place where they are translated."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from zenoh import ZError

from ros_visualise.core.errors import RosVisualiseError, Unreachable


@contextmanager
def translated(asked: str, error: type[RosVisualiseError] = Unreachable) -> Iterator[None]:
    """Call Zenoh within this, or decorate a function with it.

    Args:
        asked: the node, topic or address that is asked for.
        error: what a ZError, which Zenoh raises for everything, means here.

    Raises:
        Unreachable: this process has left the network, or cannot send.
    """
    try:
        yield
    except ZError as raised:
        text = str(raised).partition(" at /")[0].strip()
        raise error(f"{asked}: {text}") from raised
