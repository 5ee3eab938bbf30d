"""A lesson, and the data between its steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from textwrap import dedent
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np

from ros_visualise.core.errors import UnsupportedImage
from ros_visualise.data import Deferred, Header, Image, Message, Pixels, Text
from ros_visualise.nodes import NodeType
from ros_visualise.plotting.figure import Figure

WIDTH = 480
"""Width of figures with texts: they stay readable in a window of some 300 pixels."""

W = TypeVar("W")

TAKES = {"image": Image}
GIVES = {"image": Image, "text": Text}
"""Inputs and outputs of most steps: a picture, and a text about it."""


@dataclass(frozen=True)
class Step:
    """A node of a lesson, and the step whose image it takes: by default the one before it."""

    node: Any
    after: str = ""

    @property
    def declared(self) -> NodeType:
        """The node's declaration."""
        declared: NodeType = self.node.declared
        return declared


@dataclass(frozen=True)
class Origin:
    """The call of a lesson.

    Attributes:
        source: the picture or recording, for people.
        arguments: of ``ros-visualise explain``, without those of the export and `settings`.
        nodes: nodes inserted between the steps, as of ``--node``.
        settings: NODE.PARAM=VALUE, as of ``--set``.
    """

    source: str
    arguments: tuple[str, ...] = ()
    nodes: tuple[str, ...] = ()
    settings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Lesson:
    """A lesson.

    Attributes:
        name: its name on the command line.
        about: a sentence about it.
        intro: the text about its picture; empty where the steps take a stream.
        steps: its nodes; they follow the node ``picture``, which gives them the picture.
        sample: the default source, and its parameters.
        streams: its steps take the messages of a source, not a picture.
        plays: it does not begin paused.
        export_s: duration that is played before it is written down, seconds; 0 is one picture. A
            recording whose messages are taken is played to its end.
        in_time: before it is written down it is played at the recorded speed, not faster.
    """

    name: str
    about: str
    intro: str
    steps: Sequence[Step]
    sample: tuple[str, Mapping[str, Any]] = ("landscape", MappingProxyType({}))
    streams: bool = False
    plays: bool = False
    export_s: float = 0.0
    in_time: bool = False


class FigureImage(Deferred):
    """The pixels of a figure, which has its lines too."""

    def __init__(self, figure: Figure) -> None:
        self.figure = figure
        super().__init__(figure.shape, np.uint8, figure.pixels)


@dataclass(frozen=True, eq=False)
class StepResult(Image):
    """The image of a step, with data for the steps after it, and the parameters that made it."""

    work: Any = None
    settings: Any = None


def show(
    image: Image, seen: Pixels | Figure, text: str, work: Any = None, **filled: Any
) -> dict[str, Message]:
    """The outputs of a step.

    Args:
        image: its input.
        seen: gray or BGR of 8 bits, or a figure.
        text: about it, with ``{names}`` for the numbers of this run.
        work: data for the next step; None: that of the input.
        filled: name -> number.
    """
    passed = getattr(image, "work", None) if work is None else work
    return show_at(image.header, seen, text, passed, **filled)


def show_at(
    header: Header, seen: Pixels | Figure, text: str, work: Any = None, **filled: Any
) -> dict[str, Message]:
    """The outputs of a step whose input is not an image."""
    data = FigureImage(seen) if isinstance(seen, Figure) else seen
    encoding = "mono8" if len(data.shape) == 2 else "bgr8"
    shown = StepResult(data, encoding, header, work=work)
    return {"image": shown, "text": Text(fill(text, filled), header)}


def fill(text: str, numbers: Mapping[str, Any]) -> str:
    """A text with numbers for its ``{names}``."""
    return dedent(text).format(**numbers) if numbers else dedent(text)


def work_of(image: Image, kind: type[W]) -> W:
    """The result of the step before.

    Raises:
        UnsupportedImage: the image is not from that step.
    """
    work = getattr(image, "work", None)
    if not isinstance(work, kind):
        raise UnsupportedImage(
            "the image is not from the step before: put no other node between the steps of a lesson"
        )
    return work
