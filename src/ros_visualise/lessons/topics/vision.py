"""Filter or vision: the first layer of our own network beside Sobel, and its results."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from ros_visualise.core.params import param
from ros_visualise.data import Floats, Image, Message, Pixels
from ros_visualise.landmarks.networks.candidates import Candidates, SelectionRules
from ros_visualise.landmarks.networks.network import Network
from ros_visualise.lessons.lesson import GIVES, TAKES, Lesson, Step, show, work_of
from ros_visualise.lessons.methods.layer import (
    KINDS,
    Layer,
    beside,
    correlation,
    first_layer,
    likeness,
    relu,
    respond,
    sobel_cosines,
)
from ros_visualise.lessons.methods.sobel import sobel
from ros_visualise.nodes import NoParams, node
from ros_visualise.nodes.landmark_detector import OWN_MODEL
from ros_visualise.plotting.colors import RED, levels
from ros_visualise.plotting.figure import Figure, picture_grid

_SOBEL = np.array([[-1, 0, 1], [-2, 0, 2], [-1, 0, 1]], float)


@dataclass(frozen=True, eq=False)
class _NetworkPicture:
    """A picture, the network, its first layer, and the layer's output before its ReLU."""

    bgr: Pixels
    network: Network
    layer: Layer
    answers: Floats


@node("kernels", inputs=TAKES, outputs=GIVES)
class Kernels:
    """The kernels learned by the network's first layer, beside Sobel's."""

    def __init__(self, _: NoParams) -> None:
        self._network = Network(str(OWN_MODEL))
        self._layer = first_layer(self._network.metadata)

    def step(self, image: Image, params: NoParams) -> dict[str, Message]:
        """Show the kernels and their kinds."""
        bgr = work_of(image, np.ndarray)
        kernels = self._layer.kernels
        kinds = likeness(kernels)
        counts = np.bincount(kinds.argmax(axis=1), minlength=len(KINDS))
        text = """
            A filter is a kernel that a person designed: Sobel's Gx and Gy are from 1968. The
            kernels of a network are learned: they began as random numbers, and training changed
            them step by step so that fewer landmarks were missed. These are all {count} kernels of
            our network's first layer: 3 x 3 numbers for each of red, green and blue. Gray is 0.

            The cosine of the angle between two kernels measures how alike they are; it is 1 if they
            are the same:

                cos(w, s) = Σ w s / (|w| |s|)

            There are three kinds: edge (a mix of Gx and Gy), spot (a centre against its
            surroundings) and colour (no response to gray). {edges} kernels are mostly edge, {spots}
            spot and {colors} colour. Nobody taught the network Sobel's kernels, yet it found
            similar ones:

                no    Gx    Gy edge spot colour
            {rows}
            """
        seen = _NetworkPicture(bgr, self._network, self._layer, respond(bgr, self._layer))
        rows = _table(kinds, sobel_cosines(kernels))
        edges, spots, colors = counts
        return show(image, _draw_kernels(kernels, kinds), text, seen, count=len(kernels),
                    edges=edges, spots=spots, colors=colors, rows=rows)  # fmt: skip


@node("activations", inputs=TAKES, outputs=GIVES)
def activations(image: Image, params: object) -> dict[str, Message]:
    """The response of each kernel to the picture."""
    seen = work_of(image, _NetworkPicture)
    maps = relu(seen.answers)
    active = (maps > 0).mean(axis=(1, 2))
    kinds = likeness(seen.layer.kernels)
    shown = [
        (f"{number}: {KINDS[kinds[number].argmax()]}", levels(maps[number]))
        for number in _order(kinds)
    ]
    text = f"""
        Each kernel w slides over the picture x, as Sobel's does, but two pixels at a time. Two
        things are new: a bias b is added, and results below zero become zero:

            y = max(0, b + Σ w (x − ½))

        White is the maximum of each map. Kernel {int(active.argmax())} responds at
        {100 * active.max():.0f} % of the places, more than any other; kernel {int(active.argmin())}
        responds at {100 * active.min():.1f} %, fewer than any other;
        {np.count_nonzero(active == 0)} of {len(active)} kernels respond nowhere.
        """
    return show(image, picture_grid(shown, 4), text)


@node("sobel", inputs=TAKES, outputs=GIVES)
def filters(image: Image, params: object) -> dict[str, Message]:
    """Sobel's Gx and Gy, and the kernels that are most like them."""
    seen = work_of(image, _NetworkPicture)
    gray = cv2.cvtColor(seen.bgr, cv2.COLOR_BGR2GRAY)
    cosines = sobel_cosines(seen.layer.kernels)
    shown, rows = [], []
    for axis, derivative in enumerate(sobel(gray, 3)):
        name = ("Gx", "Gy")[axis]
        there = beside(derivative)
        shown.append((name, _signed(there)))
        for sign, number in ((" ", cosines[:, axis].argmax()), ("−", cosines[:, axis].argmin())):
            shown.append(
                (f"{number}, like {sign.strip()}{name}", levels(relu(seen.answers[number])))
            )
            alike = correlation(there, seen.answers[number])
            rows.append(
                f"    {sign}{name}   {number:3}   {cosines[number, axis]:+.2f}   {alike:+.2f}"
            )
    text = """
        Sobel's derivative has a sign: white means brighter to the right (Gy: downwards), black
        means darker. A feature map of the network has no negative values. So the network needs two
        kernels, one for each sign, and it has learned both:

            like  kernel  cosine  correlation
        {rows}

        The correlation compares the kernel's responses, before negative ones become zero, with
        Sobel's derivative at all places in this picture. 1 would mean that they differ only in
        scale and bias.
        """
    return show(image, picture_grid(shown, 3), text, rows="\n".join(rows))


@dataclass(frozen=True)
class ThingsParams:
    """Thresholds of network and filter."""

    min_score: float = param(0.4, "lowest accepted score, from 0 to 1",
                             min=0.01, max=1)  # fmt: skip
    threshold: int = param(100, "value of Sobel's |G| above which a pixel is an edge",
                           min=0, max=2_000, slider=(0, 800))  # fmt: skip


@node("things", params=ThingsParams, inputs=TAKES, outputs=GIVES)
def things(image: Image, params: ThingsParams) -> dict[str, Message]:
    """Objects found by the network."""
    seen = work_of(image, _NetworkPicture)
    gray = cv2.cvtColor(seen.bgr, cv2.COLOR_BGR2GRAY)
    is_edge = np.hypot(*sobel(gray, 3)) > params.threshold
    found = seen.network.detect(seen.bgr, "BGR", SelectionRules(params.min_score))
    text = """
        A filter measures how the picture changes at each point: here |G| > {threshold} at
        {share:.1f} % of the pixels, on landmarks as well as on the ground beside them. It does not
        know what a landmark is.

        The network's later layers work in the same way: their kernels slide over the maps of the
        previous layer, and each sees a larger part of the picture. The last layers detect the
        objects:

        {found}

        The score is the network's confidence, which can be wrong. The network knows only these
        objects: {names}.
        """
    names = seen.network.names
    return show(image, _draw_things(seen.bgr, found, names), text, threshold=params.threshold,
                share=100 * is_edge.mean(), found=_listed(found, names),
                names=", ".join(names.values()))  # fmt: skip


LESSON = Lesson(
    "vision",
    "filter or vision: what our own network's first layer has learned, beside Sobel's kernels",
    """
    Sobel's kernels were designed by a person; a network's kernels are learned. Both work on the
    same {width} x {height} pixels: your picture, or a computer-drawn landscape. How alike are they?
    And what more is needed to find an object and name it?
    """,
    [
        Step(Kernels),
        Step(activations),
        Step(filters, after="activations"),
        Step(things, after="activations"),
    ],
)


def _order(kinds: Floats) -> list[int]:
    """Indices of the kernels by kind, the clearest of each first."""
    best = kinds.argmax(axis=1)
    return sorted(range(len(kinds)), key=lambda number: (best[number], -kinds[number].max()))


def _table(kinds: Floats, cosines: Floats) -> str:
    rows = []
    for number in _order(kinds):
        (gx, gy), (edge, spot, color) = cosines[number], kinds[number]
        rows.append(f"    {number:2} {gx:+.2f} {gy:+.2f} {edge:.2f} {spot:.2f} {color:.2f}")
    return "\n".join(rows)


def _draw_kernels(kernels: Floats, kinds: Floats) -> Figure:
    shown: list[tuple[str, Any]] = [("Sobel's Gx", _signed(_SOBEL)), ("Gy", _signed(_SOBEL.T))]
    for number in _order(kinds):
        kind = int(kinds[number].argmax())
        bgr = np.ascontiguousarray(kernels[number, ::-1].transpose(1, 2, 0))
        shown.append((f"{number}: {KINDS[kind]}", _signed(bgr)))
    return picture_grid(shown, 6)


def _signed(values: Floats | Pixels) -> Pixels:
    """Values with 0 as 128, and the largest magnitude as 1 or 255."""
    top = max(float(np.abs(values).max()), 1e-9)
    shown: Pixels = np.rint(128 + values * (127 / top)).astype(np.uint8)
    return shown


def _draw_things(bgr: Pixels, found: Candidates, names: dict[int, str]) -> Figure:
    height, width = bgr.shape[:2]
    figure = Figure(width, height)
    figure.picture((0, 0, width, height), bgr)
    for box, score, number in zip(found.boxes_xyxy, found.scores, found.classes, strict=True):
        left, top, right, bottom = box + 0.5
        figure.outline((left, top, right - left, bottom - top), RED, 2)
        figure.text(left, max(top - 4, 12), f"{names[int(number)]} {score:.2f}", 14, color=RED)
    return figure


def _listed(found: Candidates, names: dict[int, str]) -> str:
    if not len(found):
        return "    nothing: lower min_score, or use another picture"
    boxes = zip(found.boxes_xyxy, found.scores, found.classes, strict=True)
    return "\n".join(
        f"    {names[int(number)]:8}  {score:.2f}  at ({(box[0] + box[2]) / 2:.0f},"
        f" {(box[1] + box[3]) / 2:.0f})"
        for box, score, number in boxes
    )
