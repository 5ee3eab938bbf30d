"""What a layout is, and what of a network it is recognised by."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from ros_visualise.data import Floats
from ros_visualise.landmarks.networks.candidates import Candidates
from ros_visualise.landmarks.networks.preparation import Preparation, Size

Outputs = Mapping[str, Floats]
"""Output name -> what came out, float32 or whole numbers."""

SIZES_INPUT = "orig_target_sizes"
"""The second input that some networks have: (1, 2) width and height that their boxes are for."""

MIN_SCORE_INPUT = "min_score"
"""An input (1,) that may be given: the least score of what is wanted, to save work on the rest."""


@dataclass(frozen=True)
class Signature:
    """What is known of a network: what its file says, and what came out for an image of nothing.

    ``inputs`` are their names, ``size`` that of the image, ``metadata`` the file's own texts and
    ``class_count`` the number of classes by these; 0: they do not tell.
    """

    inputs: tuple[str, ...]
    size: Size
    outputs: Outputs
    metadata: Mapping[str, str]
    class_count: int

    @property
    def only_output(self) -> tuple[int, ...]:
        """The shape of its only output behind the batch of 1; empty where there are others."""
        shapes = [output.shape for output in self.outputs.values()]
        is_one = len(shapes) == 1 and len(shapes[0]) == 3 and shapes[0][0] == 1
        return tuple(shapes[0][1:]) if is_one else ()

    def cells(self, *strides: int) -> int:
        """How many cells there are in grids of these strides over the image."""
        width, height = self.size
        return sum(math.ceil(width / step) * math.ceil(height / step) for step in strides)

    @property
    def detects(self) -> bool:
        """Not of the Ultralytics tasks that are something else, such as poses or outlines."""
        return self.metadata.get("task", "detect") == "detect"


@dataclass(frozen=True)
class OutputLayout:
    """One way in which networks answer.

    Args:
        name: of the networks that do so.
        shapes: what comes out, for people.
        preparation: what goes in.
        fits: whether a network is one of these.
        decode: (outputs, size of what went in, least score) -> what may be there, in pixels of what
            went in, counted from its edges; those below the least score may be left out.
        overlapping: it tells the same thing several times.
    """

    name: str
    shapes: str
    preparation: Preparation
    fits: Callable[[Signature], bool]
    decode: Callable[[Outputs, Size, float], Candidates]
    overlapping: bool
