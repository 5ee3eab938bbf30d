"""A page of lines, areas, pictures, dots and texts as a PDF file, with its font embedded.

Source: ISO 32000-1, sections 7.5 (structure), 8 (graphics), 9.6 (simple fonts).
"""

from __future__ import annotations

import zlib
from functools import cache
from io import BytesIO
from typing import Any

import cv2
import numpy as np
from PIL import ImageFont

from ros_visualise.data import Floats, Pixels
from ros_visualise.plotting.colors import Color

_POINTS = 0.75  # of a unit, which is 1/96 inch
_CURVE = 0.5523  # handle of the Bezier curve that is a quarter of a circle
_ENCODING = "cp1252"
_FIRST, _LAST = 32, 255  # codes of the font's widths


class PdfPage:
    """One page; x goes right and y down, in units of 1/96 inch."""

    def __init__(self, width: float, height: float) -> None:
        self._size = width * _POINTS, height * _POINTS
        self._content = [f"{_POINTS} 0 0 {-_POINTS} 0 {self._size[1]:.2f} cm 1 J 1 j"]
        self._pictures: list[bytes] = []

    def line(self, points: Floats, color: Color, width: float) -> None:
        """Draw a line through points (N, 2)."""
        self._content.append(f"{_color(color)} RG {width:g} w {_path(points)} S")

    def area(self, points: Floats, color: Color) -> None:
        """Fill a polygon (N, 2)."""
        self._content.append(f"{_color(color)} rg {_path(points)} h f")

    def dot(self, center: Floats, radius: float, color: Color) -> None:
        """Draw a filled circle."""
        handle, (x, y) = radius * _CURVE, center
        angles = np.radians([0, 90, 180, 270, 360])
        around = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        along = np.stack([-around[:, 1], around[:, 0]], axis=1) * handle
        ends = center + radius * around
        curves = [
            " ".join(f"{number:.2f}" for number in (*a, *b, *end)) + " c"
            for a, b, end in zip((ends + along)[:-1], (ends - along)[1:], ends[1:], strict=True)
        ]
        start = f"{x + radius:.2f} {y:.2f} m"
        self._content.append(f"{_color(color)} rg {start} {' '.join(curves)} f")

    def text(self, x: float, y: float, text: str, size: float, anchor: str, color: Color) -> None:
        """Write a text; see `ros_visualise.plotting.figure.Figure.text`."""
        known = text.replace("−", "-").encode(_ENCODING, "replace")
        widths = font_widths()
        length = sum(widths[max(code - _FIRST, 0)] for code in known) * size / 1000
        x -= length * {"start": 0.0, "middle": 0.5, "end": 1.0}[anchor]
        place = f"1 0 0 -1 {x:.2f} {y:.2f} Tm"
        self._content.append(f"BT {_color(color)} rg /F {size:g} Tf {place} <{known.hex()}> Tj ET")

    def picture(self, box: tuple[float, float, float, float], pixels: Pixels) -> None:
        """Draw a picture, gray or BGR of 8 bits; enlarged, its pixels stay squares."""
        left, top, width, height = box
        number = len(self._pictures)
        place = f"{width:.2f} 0 0 {-height:.2f} {left:.2f} {top + height:.2f} cm"
        self._content.append(f"q {place} /P{number} Do Q")
        rgb = cv2.cvtColor(pixels, cv2.COLOR_GRAY2RGB if pixels.ndim == 2 else cv2.COLOR_BGR2RGB)
        rows, columns = rgb.shape[:2]
        kind = f"/Type /XObject /Subtype /Image /Width {columns} /Height {rows}"
        how = "/ColorSpace /DeviceRGB /BitsPerComponent 8"
        self._pictures.append(_stream(rgb.tobytes(), f"{kind} {how}"))

    def file(self) -> bytes:
        """The file."""
        pictures = " ".join(f"/P{n} {8 + n} 0 R" for n in range(len(self._pictures)))
        resources = f"<< /Font << /F 4 0 R >> /XObject << {pictures} >> >>"
        box = f"[0 0 {self._size[0]:.2f} {self._size[1]:.2f}]"
        page = f"/Type /Page /Parent 2 0 R /MediaBox {box} /Contents 7 0 R /Resources {resources}"
        return _file(
            [
                b"<< /Type /Catalog /Pages 2 0 R >>",
                b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
                f"<< {page} >>".encode(),
                *_font_objects(),
                _stream("\n".join(self._content).encode()),
                *self._pictures,
            ]
        )


@cache
def font_widths() -> list[float]:
    """Widths of the font's characters from the space on, thousandths of its size."""
    font = _font()
    codes = (bytes([code]).decode(_ENCODING, "replace") for code in range(_FIRST, _LAST + 1))
    return [font.getlength(character) for character in codes]


@cache
def _font() -> Any:
    """Aileron, which is in the public domain and comes with Pillow."""
    return ImageFont.load_default(1000)


def _font_objects() -> list[bytes]:
    """Objects 4 to 6: the font, its descriptor, its file."""
    data = _font().path.getvalue()
    widths = " ".join(f"{width:.0f}" for width in font_widths())
    kind = "/Type /Font /Subtype /TrueType /BaseFont /Aileron-Regular /Encoding /WinAnsiEncoding"
    limits = f"/FirstChar {_FIRST} /LastChar {_LAST} /Widths [{widths}]"
    about = (
        "/Type /FontDescriptor /FontName /Aileron-Regular /Flags 32 /FontBBox [-200 -300 1200 1000]"
        " /ItalicAngle 0 /Ascent 970 /Descent -230 /CapHeight 690 /StemV 80 /FontFile2 6 0 R"
    )
    return [
        f"<< {kind} {limits} /FontDescriptor 5 0 R >>".encode(),
        f"<< {about} >>".encode(),
        _stream(data, f"/Length1 {len(data)}"),
    ]


def _file(objects: list[bytes]) -> bytes:
    file = BytesIO()
    file.write(b"%PDF-1.4\n%\xe2\xe3\xcf\xd3\n")
    places = []
    for number, content in enumerate(objects, 1):
        places.append(file.tell())
        file.write(b"%d 0 obj\n%b\nendobj\n" % (number, content))
    start = file.tell()
    file.write(b"xref\n0 %d\n0000000000 65535 f \n" % (len(objects) + 1))
    file.writelines(b"%010d 00000 n \n" % place for place in places)
    trailer = b"trailer\n<< /Size %d /Root 1 0 R >>\nstartxref\n%d\n%%%%EOF\n"
    file.write(trailer % (len(objects) + 1, start))
    return file.getvalue()


def _stream(data: bytes, about: str = "") -> bytes:
    packed = zlib.compress(data, 9)
    head = f"<< {about} /Filter /FlateDecode /Length {len(packed)} >>"
    return head.encode() + b"\nstream\n" + packed + b"\nendstream"


def _color(color: Color) -> str:
    return " ".join(f"{level / 255:.3f}" for level in color)


def _path(points: Floats) -> str:
    steps = ("m", *("l",) * (len(points) - 1))
    return " ".join(f"{x:.2f} {y:.2f} {step}" for (x, y), step in zip(points, steps, strict=True))
