"""Pages as PDF, printed by a browser that is installed."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

from ros_visualise.core.errors import OpenError, RecordingError

_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome", "msedge", "brave-browser")
_MOST_S = 120


def find_browser() -> str:
    """The program of a browser that can print.

    Raises:
        OpenError: none is installed.
    """
    found = next((path for name in _BROWSERS if (path := shutil.which(name))), None)
    if found is None:
        raise OpenError(
            "PDF needs Chromium, Chrome or Edge on the PATH; or print index.html from a browser"
        )
    return found


def print_page(browser: str, page: Path) -> Path:
    """Print a page of ours to a PDF beside it, of the same name; returns the PDF.

    Raises:
        RecordingError: the browser failed.
    """
    pdf = page.with_suffix(".pdf")
    options = ["--headless", "--disable-gpu", "--no-pdf-header-footer", f"--print-to-pdf={pdf}"]
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        options.append("--no-sandbox")  # Chromium refuses to run as root otherwise
    command = [browser, *options, page.resolve().as_uri()]
    try:
        subprocess.run(command, check=True, capture_output=True, timeout=_MOST_S)
    except (OSError, subprocess.SubprocessError) as error:
        raise RecordingError(f"{pdf}: {browser} failed: {error}") from None
    return pdf
