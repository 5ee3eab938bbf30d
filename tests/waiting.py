"""Waiting for what comes about in another thread or process."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

PATIENCE_S = 60.0


def wait_for(
    condition: Callable[[], Any],
    what: str = "it",
    patience_s: float = PATIENCE_S,
    *,
    process: subprocess.Popen[Any] | None = None,
    sleep: Callable[[float], Any] = time.sleep,
) -> Any:
    """What the condition gives as soon as it gives something.

    Args:
        process: brings it about; when that has ended, there is nothing more to wait for.
        sleep: pauses for some seconds between two looks.
    """
    end_s, pause_s = time.monotonic() + patience_s, 0.001
    while time.monotonic() < end_s:
        has_ended = process is not None and process.poll() is not None
        if found := condition():
            return found
        assert not has_ended, f"the process ended before {what}"
        sleep(pause_s)
        pause_s = min(2 * pause_s, 0.05)
    return pytest.fail(f"waited {patience_s:g} s for {what}")


def bytes_in(path: Path) -> int:
    """Size of a file, or of the largest one in a folder; 0 where there is none yet."""
    with suppress(FileNotFoundError):  # it may be renamed meanwhile
        return max((one.stat().st_size for one in (path, *path.rglob("*"))), default=0)
    return 0
