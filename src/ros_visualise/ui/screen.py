"""The screen for windows: its presence and size, a font, and places for the windows."""

from __future__ import annotations

import ctypes
import math
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

from ros_visualise.core.errors import OpenError, UsageError

TITLE = 36  # what a window manager adds above a window, in pixels
_EDGE = 6  # and around it
_USUAL_SIZE = (1600, 900)
_NO_WINDOWS = 3
_TRIAL = f"""
import os, cv2
try:
    cv2.namedWindow("ros-visualise")
except cv2.error:
    os._exit({_NO_WINDOWS})
os._exit(0)
"""


def check_windows() -> None:
    """Open a window in another process, as Qt and GTK end one that cannot.

    Raises:
        OpenError: this OpenCV lacks windows, or the display is missing.
    """
    trial = subprocess.run(
        [sys.executable, "-c", _TRIAL],
        capture_output=True,
        text=True,
        start_new_session=True,  # Ctrl-C in the terminal ends this process silently
    )
    if trial.returncode == _NO_WINDOWS:
        raise OpenError(
            "this build of OpenCV cannot open windows; run: pip uninstall"
            " opencv-python-headless, then "
            "pip install '.[desktop]'; or use the page (--view web)"
        )
    if trial.returncode:
        raise OpenError(
            f"{_what_is_wrong(trial.stderr)}; use the page (--view web), or connect with ssh -X"
            " from another machine"
        )


def _what_is_wrong(errors: str) -> str:
    display = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if not display:
        return "no display: DISPLAY is not set"
    if "connect to display" in errors or "open display" in errors:
        return f"no display: DISPLAY={display} cannot be opened"
    return "OpenCV cannot open windows; on Debian, apt-get install libgl1 libglib2.0-0 libsm6"


def screen_size() -> tuple[int, int]:
    """Width and height of one screen in pixels; a usual size without X11."""
    try:
        x11 = ctypes.CDLL("libX11.so.6")
    except OSError:
        return _USUAL_SIZE
    x11.XOpenDisplay.restype = ctypes.c_void_p
    display = x11.XOpenDisplay(None)
    if not display:
        return _USUAL_SIZE
    handle = ctypes.c_void_p(display)
    width, height = x11.XDisplayWidth(handle, 0), x11.XDisplayHeight(handle, 0)
    x11.XCloseDisplay(handle)
    return min(width, height * 16 // 9), height  # several screens side by side count as one


def provide_font() -> tempfile.TemporaryDirectory[str] | None:
    """Point Qt to a font of the system where OpenCV's own folder of fonts is missing.

    opencv-python 5 lacks it; then no trackbar has a name. To be called before the first window,
    after cv2 was imported, which sets the variable. The returned folder, with a link to one
    monospace font, has to last as long as the windows.
    """
    given = os.environ.get("QT_QPA_FONTDIR")
    if given is None or Path(given).is_dir():
        return None
    font = _monospace_font()
    if font is None:
        return None
    folder = tempfile.TemporaryDirectory(prefix="ros_visualise-font-")
    Path(folder.name, font.name).symlink_to(font)
    os.environ["QT_QPA_FONTDIR"] = folder.name
    return folder


def _monospace_font() -> Path | None:
    if shutil.which("fc-match"):
        asked = ["fc-match", "--format=%{file}", "monospace"]
        found = Path(subprocess.run(asked, capture_output=True, text=True).stdout)
        if found.is_file():
            return found
    return next(Path("/usr/share/fonts").rglob("*Mono*.ttf"), None)


class Box(NamedTuple):
    """A window's place: its top-left corner with its frame, its size without."""

    x: int
    y: int
    width: int
    height: int


def tile(area: Box, extras: list[int]) -> list[Box]:
    """Places for windows with images, in rows of equal length, all images of equal size.

    Args:
        area: the part of the screen for all of them.
        extras: for each window, the height that it needs beside its image.
    """
    if not extras:
        return []
    columns = math.ceil(math.sqrt(len(extras)))
    rows = [extras[i : i + columns] for i in range(0, len(extras), columns)]
    width = area.width // columns
    image = (area.height - sum(max(row) + TITLE for row in rows)) // len(rows)
    boxes, y = [], area.y
    for row in rows:
        for column, extra in enumerate(row):
            x, height = area.x + column * width, max(image, width // 4) + extra
            boxes.append(Box(x, y, width - _EDGE, height - _EDGE))
        y += max(image, width // 4) + max(row) + TITLE
    return boxes


def parse_place(text: str) -> tuple[int, int]:
    """(2, 4) for ``2/4``, the second of four; (1, 1) for an empty text.

    Raises:
        UsageError: it has another form.
    """
    number, slash, of = (text or "1/1").partition("/")
    if not (slash and number.isdecimal() and of.isdecimal() and 1 <= int(number) <= int(of)):
        raise UsageError(
            f"window={text}: give the position of a window, such as 2/4 for the second of four"
        )
    return int(number), int(of)


def part_of(area: Box, number: int, of: int) -> Box:
    """One of equal parts of an area, counted from 1 in rows."""
    columns = math.ceil(math.sqrt(of))
    rows = math.ceil(of / columns)
    row, column = divmod(number - 1, columns)
    width, height = area.width // columns, area.height // rows
    return Box(area.x + column * width, area.y + row * height, width, height)
