"""Errors of rclpy as errors of ours: the one place where they are translated."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ament_index_python.packages import PackageNotFoundError
from rclpy.exceptions import NameValidationException

from ros_visualise.core.errors import OpenError, RosVisualiseError, Unreachable, UsageError


@contextmanager
def translated(
    asked: str, other: type[RosVisualiseError] = Unreachable, prefix: str = "cannot query {}: "
) -> Iterator[None]:
    """Call rclpy within this, or decorate a function with it.

    Args:
        asked: the node, name or file that is asked for.
        other: error for a RuntimeError, which rclpy raises for nearly everything.
        prefix: of its text.

    Raises:
        UsageError: a name is invalid.
        OpenError: a package is missing.
        Unreachable: ROS 2 cannot ask, as on a graph that this process has left.
    """
    try:
        yield
    except RosVisualiseError:
        raise
    except PackageNotFoundError as error:
        package = error.args[0]
        why = f"no package {package!r}; try: ros2 pkg prefix {package}"
        raise OpenError(f"{asked}: {why}") from None
    except (NameValidationException, ValueError) as error:
        raise UsageError(f"invalid ROS 2 name {asked}: {_first_line(error)}") from None
    except RuntimeError as error:
        raise other(f"{prefix.format(asked)}{_first_line(error)}") from error


def _first_line(error: Exception) -> str:
    """The text of an error, without where in the sources of ROS 2."""
    text = str(error).strip() or type(error).__name__
    return text.splitlines()[0].partition(", at /")[0]
