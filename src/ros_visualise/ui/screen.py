"""The screen that windows open on: whether there is one, its size, and a font for it."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from ros_visualise.core.errors import OpenError

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
    """Open a window in a process of its own, because Qt and GTK end a process that cannot.

    Raises:
        OpenError: this OpenCV has no windows, or there is no screen for them.
    """
    trial = subprocess.run(
        [sys.executable, "-c", _TRIAL],
        capture_output=True,
        text=True,
        start_new_session=True,  # Ctrl-C in the terminal ends this process, and says nothing of it
    )
    if trial.returncode == _NO_WINDOWS:
        raise OpenError(
            "this OpenCV has no windows: pip uninstall opencv-python-headless, then pip "
            "install '.[desktop]'; or take the page (view web)"
        )
    if trial.returncode:
        raise OpenError(
            f"{_what_is_wrong(trial.stderr)}; take the page (view web), or ssh -X from "
            "another machine"
        )


def _what_is_wrong(errors: str) -> str:
    display = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if not display:
        return "no screen for windows: DISPLAY is not set"
    if "connect to display" in errors or "open display" in errors:
        return f"no screen for windows: DISPLAY={display} cannot be opened"
    return "OpenCV's windows do not start: on Debian, apt-get install libgl1 libglib2.0-0 libsm6"


def screen_size() -> tuple[int, int]:
    """Width and height in pixels of one screen, or a usual size where X11 does not tell."""
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

    opencv-python 5 came without one; then no trackbar has a name. To be called before the first
    window, after cv2 was imported, which sets the variable. The folder returned, with a link to
    one font whose letters are equally wide, has to last as long as the windows.
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
