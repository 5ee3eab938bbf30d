"""Object detection by a network."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ros_visualise.core.errors import OpenError, RosVisualiseError
from ros_visualise.data import Floats, Pixels
from ros_visualise.landmarks.networks import layouts
from ros_visualise.landmarks.networks.candidates import Candidates, SelectionRules, choose
from ros_visualise.landmarks.networks.layouts import OutputLayout, Signature
from ros_visualise.landmarks.networks.layouts.layout import MIN_SCORE_INPUT, SIZES_INPUT
from ros_visualise.landmarks.networks.names import names_in
from ros_visualise.landmarks.networks.preparation import CELL, Resizing, Size, fitting_size, prepare
from ros_visualise.landmarks.networks.remote import open_session
from ros_visualise.landmarks.networks.session import Provider, Session, TensorPort

_TYPES: dict[str, np.dtype[Any]] = {
    "tensor(float)": np.dtype(np.float32),
    "tensor(float16)": np.dtype(np.float16),
}
_MIN_SCORE = TensorPort(MIN_SCORE_INPUT, "tensor(float)", (1,))
_USUAL_SIDE = 640
_LARGEST_SIDE = 8192
_MOST_OF_EACH = 6  # inputs or outputs listed in a message


class Network:
    """An ONNX file and the layout of its outputs.

    Opening runs it once on a blank image. This gives the shapes of its outputs, which files need
    not contain, and shows if it runs at all.

    Args:
        path: the file.
        provider: hardware to run on.
        threads: number of threads per image.
        longest: longer side of the input, pixels, for networks that take any size; 0: from the
            file, else 640.

    Raises:
        OpenError: it cannot be opened or run, or its layout is unknown.
    """

    def __init__(
        self, path: str, provider: Provider = Provider.CPU, threads: int = 1, longest: int = 0
    ) -> None:
        self._session = open_session(path, provider, threads)
        self._image, self._dtype, self._fixed = _image_input(self._session)
        self.names = names_in(self._session.metadata)
        self._longest = longest or _side_in(self._session.metadata)
        self._cell = max(CELL, _numbers_in(self._session.metadata.get("stride", ""))[0])
        self._blob = self._blob_of(
            fitting_size((1, 1), self._longest, Resizing.STRETCH, self._cell)
        )
        self.layout, self._outputs = self._recognise()

    @property
    def metadata(self) -> Mapping[str, str]:
        """Metadata of the file."""
        return self._session.metadata

    def detect(self, pixels: Pixels, order: str, choice: SelectionRules) -> Candidates:
        """Detect objects in an image.

        Args:
            pixels: (height, width) or (height, width, 3 or 4), 8 or 16 bits a channel.
            order: of its colours, ``RGB`` or ``BGR``.
            choice: the rules for accepting candidates.

        Returns:
            Objects in pixels of the image, origin at the centre of the top-left one; best first.

        Raises:
            RosVisualiseError: the network fails on this image.
        """
        fit = self.layout.preparation.fit
        image = (pixels.shape[1], pixels.shape[0])
        self._blob = self._blob_of(fitting_size(image, self._longest, fit, self._cell))
        placement = prepare(pixels, order, self.layout.preparation, self._blob)
        size = _size_of(self._blob)
        outputs = self._run(self._outputs, choice.min_score)
        try:
            with np.errstate(all="ignore"):  # NaN is dropped
                found = self.layout.decode(outputs, size, choice.min_score)
                found = choose(found, choice, self.layout.overlapping)
        except (
            IndexError,
            KeyError,
            ValueError,
        ) as error:  # shapes differ from those of the first image
            raise RosVisualiseError(f"{self._session.path}: {error}") from None
        return placement.to_image(found)

    def _blob_of(self, size: Size) -> Floats:
        """The input array, reused while the size stays the same."""
        width, height = self._fixed[0] or size[0], self._fixed[1] or size[1]
        blob: Floats | None = getattr(self, "_blob", None)
        if blob is not None and blob.shape[2:] == (height, width):
            return blob
        return np.zeros((1, 3, height, width), self._dtype)

    def _run(self, names: list[str], min_score: float = 0.0) -> dict[str, Any]:
        inputs: dict[str, Any] = {self._image: self._blob}
        if _MIN_SCORE in self._session.optional:
            inputs[MIN_SCORE_INPUT] = np.array([min_score], np.float32)
        if any(one.name == SIZES_INPUT for one in self._session.inputs):
            inputs[SIZES_INPUT] = np.array([_size_of(self._blob)], np.int64)
        outputs = zip(names, self._session.run(inputs, names), strict=True)
        return {name: _as_float32(output) for name, output in outputs}

    def _recognise(self) -> tuple[OutputLayout, list[str]]:
        names = [one.name for one in self._session.outputs]
        try:
            outputs = self._run(names)
        except RosVisualiseError as error:
            raise OpenError(f"{error}; give another network") from None
        inputs = tuple(one.name for one in self._session.inputs)
        size, metadata = _size_of(self._blob), self._session.metadata
        found = Signature(inputs, size, outputs, metadata, len(self.names))
        for layout in layouts.ALL:
            if layout.fits(found):
                return layout, names
        raise OpenError(_not_understood(self._session, outputs))


def _as_float32(output: Any) -> Any:
    if not isinstance(output, np.ndarray):  # a sequence or a map, unknown to all layouts
        return np.zeros(0, np.float32)
    return output.astype(np.float32) if output.dtype == np.float16 else output


def _size_of(blob: Floats) -> Size:
    return blob.shape[3], blob.shape[2]


def _image_input(session: Session) -> tuple[str, np.dtype[Any], tuple[int, int]]:
    """Name and type of the image input; its width and height, 0 if free."""
    others = [one for one in session.inputs if one.name != SIZES_INPUT]
    if len(others) == 1 and len(others[0].shape) == 4 and others[0].type in _TYPES:
        batch, channels, height, width = (_fixed(side) for side in others[0].shape)
        fits = batch in (0, 1) and channels in (0, 3) and max(width, height) <= _LARGEST_SIDE
        if fits:
            return others[0].name, _TYPES[others[0].type], (width, height)
    there = _listed(session.inputs, [one.shape for one in session.inputs])
    raise OpenError(
        f"{session.path}: takes {there}; supported: one image [1, 3, height, width]"
        " of float or float16"
    )


def _fixed(side: Any) -> int:
    """Length of a side; 0 if it is free (None or a name)."""
    return side if isinstance(side, int) and side > 0 else 0


def _side_in(metadata: Mapping[str, str]) -> int:
    """The longer side of the images for which Ultralytics exported the network."""
    return max(_numbers_in(metadata.get("imgsz", ""))) or _USUAL_SIDE


def _numbers_in(text: str) -> list[int]:
    """The integers in a short text, limited to valid sides; [0] if none."""
    found = [int(number) for number in re.findall(r"\d{1,4}", text[:100])]
    return [number for number in found if number <= _LARGEST_SIDE] or [0]


def _not_understood(session: Session, outputs: Mapping[str, Any]) -> str:
    inputs = _listed(session.inputs, [one.shape for one in session.inputs])
    came = _listed(session.outputs, [outputs[one.name].shape for one in session.outputs])
    task = session.metadata.get("task", "detect")
    of = f" for the task {task[:20]}" if task != "detect" else ""
    known = "; ".join(f"{one.name}: {one.shapes}" for one in layouts.ALL)
    what = f"unsupported network{of}: inputs {inputs}, outputs {came}"
    return f"{session.path}: {what}; supported: {known}"


def _listed(arrays: Sequence[TensorPort], shapes: list[Sequence[Any]]) -> str:
    words = [f"{a.name[:40]} {str(list(s))[:60]}" for a, s in zip(arrays, shapes, strict=True)]
    shown = ["".join(c for c in word if c.isprintable()) for word in words]
    more = ["..."] if len(shown) > _MOST_OF_EACH else []
    return ", ".join([*shown[:_MOST_OF_EACH], *more]) or "nothing"
