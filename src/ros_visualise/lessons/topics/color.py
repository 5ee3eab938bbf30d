"""Colours as numbers: the cube of red, green and blue; hue, saturation and value; gray."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import cv2
import numpy as np

from ros_visualise.core.params import param
from ros_visualise.data import (
    Floats,
    Header,
    Image,
    Marker,
    MarkerArray,
    MarkerType,
    Message,
    Pixels,
)
from ros_visualise.lessons.lesson import GIVES, TAKES, WIDTH, Lesson, Step, show, work_of
from ros_visualise.lessons.magnifier import PixelParams
from ros_visualise.lessons.methods.colors import GRAY_WEIGHTS, to_gray, to_hsv
from ros_visualise.nodes import node
from ros_visualise.plotting.colors import GRAY
from ros_visualise.plotting.figure import Figure, picture_grid
from ros_visualise.vision.color import hsv_mask

_SIDE, _DOT, _LETTERS = 1.6, 0.02, 0.1
"""Sizes in 3D, metres: the cube's edges, the points, the names of its corners."""
_EDGES = [[one, one ^ bit] for one in range(8) for bit in (1, 2, 4) if not one & bit]
"""Pairs of the cube's corners, numbered by the bits of x, y and z."""
_TURN, _TILT = np.radians(-35), np.radians(25)


_GIVES = {**GIVES, "markers": MarkerArray}
_CORNERS = {"black": (0, 0, 0), "red": (1, 0, 0), "green": (0, 1, 0), "blue": (0, 0, 1),
            "white": (1, 1, 1)}  # fmt: skip


@dataclass(frozen=True)
class CubeParams:
    """Number of drawn pixels."""

    points: int = param(20_000, "max points", min=100, max=200_000,
                        slider=(1000, 50_000))  # fmt: skip


@node("cube", params=CubeParams, inputs=TAKES, outputs=_GIVES)
def cube(image: Image, params: CubeParams) -> dict[str, Message]:
    """The RGB cube: each pixel is a point in space."""
    bgr = work_of(image, np.ndarray)
    every = -(-bgr.shape[0] * bgr.shape[1] // params.points)
    chosen = bgr.reshape(-1, 3)[::every]
    kinds = len(np.unique(bgr.reshape(-1, 3) @ np.array([1, 256, 65536])))
    axes = np.linalg.eigvalsh(np.cov(bgr.reshape(-1, 3).T.astype(float), ddof=0) + np.eye(3) * 1e-9)
    text = f"""
        Red, green and blue are three directions in space, so each pixel is a point in a cube:
        black is at one corner, white at the opposite one, gray on the line between them. Turn it in
        the 3D view.

        This picture has {kinds} of the 16777216 possible colours. {100 * axes[-1] / axes.sum():.0f}
        % of their variance lies along one direction, the one in which they differ most. At 100 %
        all points would lie on a line, and one number per pixel, as in a gray picture, would be
        enough.
        """
    return show(image, _draw_cube(chosen), text) | {"markers": _markers(chosen, image.header)}


@node("hsv", params=PixelParams, inputs=TAKES, outputs=GIVES)
def hsv(image: Image, params: PixelParams) -> dict[str, Message]:
    """HSV: the hue, its saturation and its brightness."""
    bgr = work_of(image, np.ndarray)
    found = to_hsv(bgr)
    row, column = np.unravel_index(found[..., 1].argmax(), bgr.shape[:2])
    x, y = params.pixel(bgr.shape, (int(column), int(row)))
    theirs = cv2.cvtColor(bgr, cv2.COLOR_BGR2HSV)
    full = np.full(found.shape[:2], 255, np.uint8)
    hue = cv2.cvtColor(cv2.merge([found[..., 0], full, full]), cv2.COLOR_HSV2BGR)
    text = """
        With V = max(R, G, B) and C = V − min(R, G, B):

            S = 255 C / V
            H = 30 (G − B) / C           if V = R
                60 + 30 (B − R) / C      if V = G
                120 + 30 (R − G) / C     if V = B
            H + 180                      if H < 0

        Gray (C = 0) has no hue, and black (V = 0) no saturation: both are set to 0.

        Hue is an angle: red at 0°, green at 120°, blue at 240°. OpenCV halves it, 0 to 179, so that
        it fits into 8 bits; red is at both ends. At ({x}, {y}), R {red}, G {green}, B {blue}
        becomes H {h} ({degrees}°), S {s}, V {v}. cv2.cvtColor differs from these formulas in
        {differ} of {all} numbers. Click another pixel.
        """
    blue, green, red = (int(one) for one in bgr[y, x])
    h, s, v = (int(one) for one in found[y, x])
    seen = picture_grid(
        [("picture", bgr), ("H: hue", hue), ("S: saturation", found[..., 1]),
         ("V: value", found[..., 2])],
        2,
    )  # fmt: skip
    return show(
        image,
        seen,
        text,
        **{"x": x, "y": y, "red": red, "green": green, "blue": blue, "h": h, "s": s, "v": v},
        degrees=2 * h,
        differ=int((found != theirs).sum()),
        all=found.size,
    )


@dataclass(frozen=True)
class RangeParams:
    """The range of colours to keep."""

    hue_low: int = param(
        35,
        "lowest hue; if it is above the highest one, the range passes through red",
        min=0,
        max=179,
    )
    hue_high: int = param(85, "highest hue", min=0, max=179)
    saturation: int = param(60, "lowest saturation", min=0, max=255)
    value: int = param(40, "lowest value", min=0, max=255)


@node("hue_range", params=RangeParams, inputs=TAKES, outputs=GIVES)
def hue_range(image: Image, params: RangeParams) -> dict[str, Message]:
    """A range of hues finds objects by their colour."""
    bgr = work_of(image, np.ndarray)
    low = params.hue_low, params.saturation, params.value
    mask = hsv_mask(bgr, "BGR", low, (params.hue_high, 255, 255))
    dim = cv2.cvtColor(cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY) // 3, cv2.COLOR_GRAY2BGR)
    text = f"""
        Light and shadow change R, G and B together, but hardly the hue. So objects are selected by
        their hue: here from {params.hue_low} to {params.hue_high}, that is {2 * params.hue_low}° to
        {2 * params.hue_high}°{", through red" if params.hue_low > params.hue_high else ""}. Gray
        has no hue, so the saturation must be at least {params.saturation}, and the value at least
        {params.value}. {100 * (mask > 0).mean():.1f} % of the pixels are in this range and keep
        their colours; the others are shown dark and gray.
        """
    return show(image, np.where(mask[..., None] > 0, bgr, dim), text)


@node("gray", inputs=TAKES, outputs=GIVES)
def gray(image: Image, params: object) -> dict[str, Message]:
    """Gray: a weighted sum of the three."""
    bgr = work_of(image, np.ndarray)
    weighted = to_gray(bgr)
    mean = bgr.mean(axis=2)
    theirs = cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY)
    text = """
        The eye sees green best and blue worst. A gray picture should look as bright as the colours,
        so they get different weights:

            Y = {r} R + {g} G + {b} B

        The plain mean (R + G + B) / 3 differs from Y by {difference:.1f} levels on average in this
        picture, and by {largest:.1f} at most. cv2.cvtColor differs from the weighted sum in
        {differ} of {all} pixels.
        """
    apart = np.abs(weighted - mean)
    blue, _, red = cv2.split(bgr)
    seen = picture_grid(
        [
            ("weighted", weighted),
            ("plain mean", np.rint(mean).astype(np.uint8)),
            ("red alone", red),
            ("blue alone", blue),
        ],
        2,
    )
    return show(
        image,
        seen,
        text,
        **{name.lower(): weight for name, weight in GRAY_WEIGHTS.items()},
        difference=apart.mean(),
        largest=apart.max(),
        differ=int((weighted != theirs).sum()),
        all=weighted.size,
    )


LESSON = Lesson(
    "color",
    "colours as numbers: your picture in the RGB cube in 3D, HSV with hues to 180, gray",
    """
    A colour is three numbers, but which three? Red, green and blue are what cameras measure and
    screens emit; hue, saturation and value are closer to how people describe colours. This picture
    has {width} x {height} pixels.
    """,
    [Step(cube), Step(hsv, "picture"), Step(hue_range, "picture"), Step(gray, "picture")],
)


def _markers(colors: Pixels, header: Header) -> MarkerArray:
    """Colours (N, 3) in BGR in the cube: x is red, y green, z blue; its centre is the origin."""
    rgb = colors[:, ::-1] / 255
    corners = np.array(list(product((0.0, 1.0), repeat=3)))
    points = Marker(
        MarkerType.POINTS,
        scale_xyz=np.full(3, _DOT),
        points_xyz=_place(rgb),
        colors_rgba=np.column_stack([rgb, np.ones(len(rgb))]),
        header=header,
    )
    edges = Marker(
        MarkerType.LINE_LIST,
        scale_xyz=np.full(3, 0.008),
        color_rgba=np.array([0.6, 0.6, 0.6, 1], np.float32),
        points_xyz=_place(corners[np.array(_EDGES).ravel()]),
        id=1,
        header=header,
    )
    names = [
        Marker(
            MarkerType.TEXT_VIEW_FACING,
            position_xyz=_place(np.array(corner)) * 1.1,
            scale_xyz=np.full(3, _LETTERS),
            text=name,
            id=number,
            header=header,
        )
        for number, (name, corner) in enumerate(_CORNERS.items(), 2)
    ]
    return MarkerArray((points, edges, *names))


def _place(rgb: Floats) -> Floats:
    """Positions in 3D of colours from 0 to 1, metres."""
    places: Floats = (rgb - 0.5) * _SIDE
    return places


def _draw_cube(colors: Pixels) -> Figure:
    """The cube from an oblique view, the nearest points last."""
    side = 400
    figure = Figure(WIDTH, side)
    picture = np.full((side, WIDTH, 3), 255, np.uint8)
    rgb = colors[:, ::-1].astype(float) / 255
    places, depth = _project(rgb, side)
    order = depth.argsort()[::-1]
    column, row = np.rint(places[order]).astype(int).T
    for shift in ((0, 0), (1, 0), (0, 1), (1, 1)):
        picture[row + shift[1], column + shift[0]] = colors[order]
    figure.picture((0, 0, WIDTH, side), picture)
    shown, _ = _project(np.array(list(product((0.0, 1.0), repeat=3))), side)
    for pair in _EDGES:
        figure.line(shown[pair, :], GRAY, 1)
    for name, place in _CORNERS.items():
        x, y = _project(np.array([place], float), side)[0][0]
        figure.text(x + 6, y - 6, name, 15)
    return figure


def _project(rgb: Floats, side: int) -> tuple[Floats, Floats]:
    """Points of the cube on the figure, (N, 2), and their depth."""
    x, y, z = (rgb - 0.5).T
    across = x * np.cos(_TURN) - y * np.sin(_TURN)
    away = x * np.sin(_TURN) + y * np.cos(_TURN)
    up = z * np.cos(_TILT) + away * np.sin(_TILT)
    depth = away * np.cos(_TILT) - z * np.sin(_TILT)
    scale = 0.56 * side
    return np.stack([WIDTH / 2 + across * scale, side / 2 - up * scale], axis=1), depth
