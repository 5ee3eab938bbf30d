"""Layouts of networks, and how they are recognised."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from ros_visualise.data import Floats
from ros_visualise.landmarks.networks.candidates import Candidates
from ros_visualise.landmarks.networks.preparation import Preparation, Size

Outputs = Mapping[str, Floats]
"""Output name -> array, float32 or integer."""

SIZES_INPUT = "orig_target_sizes"
"""Optional second input: (1, 2) width and height for the output boxes."""

MIN_SCORE_INPUT = "min_score"
"""Optional input (1,): the smallest wanted score, to save work on the rest."""


@dataclass(frozen=True)
class Signature:
    """Properties of a network: its metadata, and its outputs for a blank image.

    ``inputs`` are their names, ``size`` is that of the image, ``metadata`` the file's own texts and
    ``class_count`` the number of classes according to these; 0 if unknown.
    """

    inputs: tuple[str, ...]
    size: Size
    outputs: Outputs
    metadata: Mapping[str, str]
    class_count: int

    @property
    def only_output(self) -> tuple[int, ...]:
        """Shape of the only output after the batch dimension of 1; empty if there are several."""
        shapes = [output.shape for output in self.outputs.values()]
        is_one = len(shapes) == 1 and len(shapes[0]) == 3 and shapes[0][0] == 1
        return tuple(shapes[0][1:]) if is_one else ()

    def cells(self, *strides: int) -> int:
        """Number of cells in grids of these strides over the image."""
        width, height = self.size
        return sum(math.ceil(width / step) * math.ceil(height / step) for step in strides)

    @property
    def detects(self) -> bool:
        """False for Ultralytics tasks other than detection, such as poses or outlines."""
        return self.metadata.get("task", "detect") == "detect"


@dataclass(frozen=True)
class OutputLayout:
    """One output layout.

    Args:
        name: of the networks with it.
        shapes: of the outputs, in words.
        preparation: of the input.
        fits: True if a network has this layout.
        decode: (outputs, input size, smallest score) -> candidates in pixels of the input, counted
            from its edges; those below the smallest score may be omitted.
        overlapping: True if an object may be reported several times.
    """

    name: str
    shapes: str
    preparation: Preparation
    fits: Callable[[Signature], bool]
    decode: Callable[[Outputs, Size, float], Candidates]
    overlapping: bool
