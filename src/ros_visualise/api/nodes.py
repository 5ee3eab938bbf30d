"""Nodes as plain functions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from ros_visualise.core.declarations import NodeType, declaration_of
from ros_visualise.core.errors import UsageError, did_you_mean
from ros_visualise.core.message import Message
from ros_visualise.core.params import update
from ros_visualise.core.synchronizer import EACH
from ros_visualise.data import Image, Pixels
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.nodes import find_node
from ros_visualise.runtime.runner import by_output, make_state, require_output
from ros_visualise.vision.color import encoding_of

M = TypeVar("M", bound=Message)
ImageLike = Image | Pixels


class NodeAnswer(dict[str, Message]):
    """The messages of a node by their outputs; an output without a message is missing."""

    def of(self, output: str, kind: type[M]) -> M:
        """The message of an output, which is of this class.

        Raises:
            UsageError: no message, or one of another class.
        """
        found = self.get(output)
        if not isinstance(found, kind):
            there = ", ".join(f"{name}: {type(one).__name__}" for name, one in self.items())
            raise UsageError(
                f"no output {output} of type {kind.__name__}; the result has {there or 'none'}"
            )
        return found


class NodeFunction:
    """A node as a function of its inputs, by their order or by name; `node_function` makes it.

    An input of images takes an array too, gray or BGR. A node with state keeps it from call to
    call. Errors of the node are raised.

    Attributes:
        declared: inputs, outputs and documentation of the node.
        params: its parameters.
        frames: the transforms that a node with ``frames=True`` looks up; add them with
            ``frames.add(transforms)``.
    """

    def __init__(self, declared: NodeType, params: Any) -> None:
        self.declared, self.params = declared, params
        self.frames = FrameTree()
        self._state = make_state(declared.name, lambda: declared.make(params))

    def __call__(self, *inputs: ImageLike | Message, **named: ImageLike | Message) -> NodeAnswer:
        """The node's answer to one message, or to one set of them.

        Raises:
            UsageError: an input is missing, unknown or of the wrong type.
        """
        messages = self._checked(dict(zip(self.declared.stepped, inputs, strict=False)) | named)
        if len(inputs) > len(self.declared.stepped):
            raise UsageError(f"{self.declared.name}: takes {self._expected}")
        extras: dict[str, Any] = {"params": self.params}
        if self.declared.timed:
            first: Any = next(iter(messages.values()))
            extras["arrival_ns"] = first.header.stamp_ns
        if self.declared.frames:
            extras["frames"] = self.frames
        return self._answer(self._state.step(**messages, **extras))

    def finish(self) -> NodeAnswer:
        """The last answer of a node with state, at the end of its stream."""
        return self._answer(self._state.finish())

    @property
    def _expected(self) -> str:
        return ", ".join(f"{port}: {kind.__name__}" for port, kind in self.declared.stepped.items())

    def _answer(self, given: Any) -> NodeAnswer:
        found = NodeAnswer()
        for name, message in by_output(self.declared, given).items():
            if message is not None:
                require_output(self.declared, name, message)
                found[name] = message
        return found

    def _checked(self, given: dict[str, Any]) -> dict[str, Message]:
        declared, found = self.declared, {}
        for port, message in given.items():
            if port not in declared.stepped:
                hint = did_you_mean(port, declared.stepped)
                raise UsageError(f"{declared.name}: no input {port!r}{hint}")
            kind = declared.stepped[port]
            is_array = kind is Image and isinstance(message, np.ndarray)
            found[port] = as_image(message) if is_array else message
            if not isinstance(found[port], kind):
                given_kind = type(message).__name__
                raise UsageError(f"{declared.name}: {port} takes {kind.__name__}, not {given_kind}")
        if not found or (declared.sync != EACH and found.keys() != declared.stepped.keys()):
            raise UsageError(f"{declared.name}: takes {self._expected}")
        return found


def node_function(node: str | NodeType | Callable[..., Any], **params: Any) -> NodeFunction:
    """A node as a function.

    Args:
        node: name of a node, ``FILE.py:NAME``, or a function or class under ``@node``.
        params: its parameters; ``ros-visualise nodes NAME`` lists them.

    Raises:
        ParameterError: an unknown parameter, or a value out of its range.
        UsageError: no such node.
    """
    declared = find_node(node) if isinstance(node, str) else declaration_of(node)
    return NodeFunction(declared, update(declared.params(), params))


def as_image(image: ImageLike) -> Image:
    """An array as an image, gray or BGR, of 8 or 16 bits.

    Raises:
        UsageError: an array of another shape or type.
    """
    if isinstance(image, Image):
        return image
    is_known = image.dtype in (np.uint8, np.uint16) and image.ndim in (2, 3)
    if not is_known or image.shape[2:] not in ((), (3,), (4,)):
        raise UsageError(
            f"an array of {image.dtype} with shape {image.shape} is not an image; give uint8 or"
            " uint16, (height, width) or (height, width, 3) in BGR order"
        )
    return Image(image, encoding_of(image, "BGR"))
