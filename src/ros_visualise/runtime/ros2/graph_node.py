"""rclpy's node, with values of parameters as people write them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from rclpy.node import Node
from rclpy.parameter import Parameter

Convert = Callable[[Parameter], Parameter]


class GraphNode(Node):  # type: ignore[misc]
    """Converts the parameters that it is asked to set, before rclpy compares their types.

    ``ros2 param set`` and ``load`` take ``off`` for a bool and ``2`` for an int.

    Attributes:
        convert: gives a parameter in the type that is declared.
    """

    convert: Convert = staticmethod(lambda asked: asked)

    def set_parameters(self, parameter_list: Sequence[Parameter]) -> Any:
        """Set parameters one by one."""
        return super().set_parameters([self.convert(one) for one in parameter_list])

    def set_parameters_atomically(self, parameter_list: Sequence[Parameter]) -> Any:
        """Set all of these parameters or none."""
        return super().set_parameters_atomically([self.convert(one) for one in parameter_list])
