"""What rclpy raises where other nodes are asked, as errors of ours."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ros_visualise.core.errors import RosVisualiseError, Unreachable


@contextmanager
def asking(whom: str) -> Iterator[None]:
    """Within this somebody is asked; what rclpy raises, always a RuntimeError, becomes ours.

    Raises:
        Unreachable: ROS 2 cannot ask, as on a graph that this process has left.
    """
    try:
        yield
    except RosVisualiseError:
        raise
    except RuntimeError as error:
        raise Unreachable(f"{whom} cannot be asked: {str(error).splitlines()[0]}") from error
