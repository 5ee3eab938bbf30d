"""Printing boards and tags to scale, as SVG or PDF."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from io import BytesIO

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image as Pictures

from ros_visualise.core.errors import UsageError
from ros_visualise.data import Floats
from ros_visualise.landmarks.calibration.boards import Board, BoardKind, dark_rectangles, outer_size
from ros_visualise.landmarks.tags import Family, draw_cells

PAGES = {"A4": (210.0, 297.0), "A3": (297.0, 420.0), "Letter": (215.9, 279.4)}
"""Name -> width and height, mm."""
_MARGIN_MM = 10.0  # unprintable margin
_FOOT_MM = 22.0  # for the text below
_LEAST_MM = 1.0
_DPI = 600
_MM_PER_INCH = 25.4
_RULER_MM = 100


@dataclass(frozen=True)
class Sheet:
    """A pattern on a page; all lengths in millimetres.

    ``left`` and ``top`` are those of the pattern, ``side`` is that of its squares or tags;
    ``dark`` are the black rectangles, (N, 4): x, y, width and height on the page.
    """

    width: float
    height: float
    left: float
    top: float
    side: float
    dark: Floats
    caption: str


def lay_out(board: Board, page: str, square: float | None) -> Sheet:
    """A board centred on a page, portrait or landscape, whichever fits better.

    Args:
        board: to print.
        page: one of `PAGES`, or WIDTHxHEIGHT in millimetres.
        square: side of a square or tag, metres; None: whole millimetres, as large as possible.

    Raises:
        UsageError: unknown page, or the board does not fit on it.
    """

    def caption(side: float) -> str:
        share = f"{side * board.share:g} mm"
        sides = {
            BoardKind.CHESSBOARD: f"{side:g} mm squares",
            BoardKind.CHARUCO: f"{side:g} mm squares, {share} markers ({board.dictionary})",
            BoardKind.APRILGRID: f"{side:g} mm tags, {share} apart",
        }
        return f"{board.noun} of {board.counts}, {sides[board.kind]}"

    unit = replace(board, square=1.0)
    what = f"a board of {board.counts}", "--square"
    return _centred(dark_rectangles(unit), outer_size(unit), page, square, what, caption)


def lay_out_tag(family: Family, id: int, page: str, size: float | None) -> Sheet:
    """A tag centred on a page; ``size`` is the side by which it is measured, metres.

    Raises:
        ParameterError: the family has no such tag.
        UsageError: unknown page, or the tag does not fit on it.
    """
    cells, rim = draw_cells(family, id)
    count = len(cells)
    rows = [
        (start, row, stop - start, 1)
        for row, bits in enumerate(cells)
        for start, stop in np.flatnonzero(np.diff(bits == 0, prepend=False, append=False)).reshape(
            -1, 2
        )
    ]
    whole = count / (count - 2 * rim)
    dark = np.array(rows) / (count - 2 * rim)
    what = f"a tag of {family.name}", "--size"
    return _centred(
        dark, (whole, whole), page, size, what, lambda side: f"{family.name}, id {id}, {side:g} mm"
    )


def _centred(
    dark: Floats,
    unit: tuple[float, float],
    page: str,
    given: float | None,
    what: tuple[str, str],
    caption: Callable[[float], str],
) -> Sheet:
    """A pattern with a side of 1, ``unit`` wide and high, as large as given or as fits the page."""
    size = _page_size(page)
    upright = np.array([min(size), max(size)]) - 2 * _MARGIN_MM
    rooms = [upright - [0, _FOOT_MM], upright[::-1] - [0, _FOOT_MM]]
    across = bool(min(rooms[1] / unit) > min(rooms[0] / unit))
    most = float(min(rooms[across] / unit))
    side = math.floor(most) if given is None else given * 1000
    if not _LEAST_MM <= side <= most:
        name, option = what
        raise UsageError(
            f"{name} with a side of {max(side, _LEAST_MM):g} mm does not fit on {page}; use at most"
            f" {math.floor(most * 10) / 10:g} mm ({option} {math.floor(most * 10) / 10000:g}) or a"
            " larger --page"
        )
    width, height = (max(size), min(size)) if across else (min(size), max(size))
    left = (width - unit[0] * side) / 2
    top = _MARGIN_MM + (height - 2 * _MARGIN_MM - _FOOT_MM - unit[1] * side) / 2
    return Sheet(width, height, left, top, side, dark * side + [left, top, 0, 0], caption(side))


def to_svg(sheet: Sheet) -> bytes:
    """An SVG file with millimetres as units."""
    path = "".join(f"M{x:.4f} {y:.4f}h{w:.4f}v{h:.4f}h{-w:.4f}z" for x, y, w, h in sheet.dark)
    marks = "".join(f"M{x:.2f} {y:.2f}v{-h:.2f}" for x, y, h in _ruler(sheet))
    size = f'width="{sheet.width:g}mm" height="{sheet.height:g}mm"'
    box = f'viewBox="0 0 {sheet.width:g} {sheet.height:g}"'
    texts = "".join(
        f'<text x="{x:.2f}" y="{y:.2f}" font-size="3.5" font-family="sans-serif">{text}</text>'
        for x, y, text in _texts(sheet)
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} {box}>'
        f'<rect width="100%" height="100%" fill="white"/><path d="{path}"/>'
        f'<path d="{marks}" stroke="black" stroke-width="0.2"/>{texts}</svg>\n'
    ).encode()


def to_pdf(*sheets: Sheet) -> bytes:
    """A PDF file with an image of 1/600 inch pixels on each page: edges are exact to 0.02 mm."""
    file = BytesIO()
    first, *rest = (Pictures.fromarray(rasterise(one, _DPI)).convert("1") for one in sheets)
    first.save(file, "PDF", resolution=_DPI, save_all=True, append_images=rest)
    return file.getvalue()


SHEET_FORMATS: dict[str, Callable[[Sheet], bytes]] = {".pdf": to_pdf, ".svg": to_svg}
"""File suffix -> writer."""


def rasterise(sheet: Sheet, dpi: float) -> npt.NDArray[np.uint8]:
    """The page as a gray image, (height, width)."""
    scale = dpi / _MM_PER_INCH
    page = np.full((round(sheet.height * scale), round(sheet.width * scale)), 255, np.uint8)
    for x, y, w, h in sheet.dark:
        left, top, right, bottom = np.rint(np.array([x, y, x + w, y + h]) * scale).astype(int)
        page[top:bottom, left:right] = 0
    for x, y, h in _ruler(sheet):
        low, high = ((round(x * scale), round(at * scale)) for at in (y, y - h))
        cv2.line(page, low, high, 0, max(1, round(0.2 * scale)))
    for x, y, text in _texts(sheet):
        place = round(x * scale), round(y * scale)
        size = 3.5 * scale / 30
        cv2.putText(page, text, place, cv2.FONT_HERSHEY_SIMPLEX, size, 0, max(1, round(size * 1.5)))
    return page


def _page_size(page: str) -> tuple[float, float]:
    known = {name.lower(): size for name, size in PAGES.items()}
    if page.lower() in known:
        return known[page.lower()]
    width, _, height = page.lower().partition("x")
    try:
        size = float(width), float(height)
    except ValueError:
        size = (0.0, 0.0)
    if not all(50 <= side <= 2000 for side in size):
        raise UsageError(
            f"--page {page}: give {', '.join(PAGES)} or WIDTHxHEIGHT in mm, from 50 to 2000"
        )
    return size


def _ruler(sheet: Sheet) -> list[tuple[float, float, float]]:
    """(x, lower end, length) of the marks of a ruler, one per centimetre."""
    left, bottom = _MARGIN_MM, sheet.height - _MARGIN_MM
    length = min(_RULER_MM, int(sheet.width - 2 * _MARGIN_MM) // 10 * 10)
    return [(left + at, bottom, 5.0 if at % 50 == 0 else 3.0) for at in range(0, length + 1, 10)]


def _texts(sheet: Sheet) -> list[tuple[float, float, str]]:
    bottom = sheet.height - _MARGIN_MM
    length = (len(_ruler(sheet)) - 1) * 10
    return [
        (_MARGIN_MM, bottom - 13, sheet.caption),
        (
            _MARGIN_MM,
            bottom - 7.5,
            f"Print at 100 %: these marks are 10 mm apart, {length} mm in total.",
        ),
    ]
