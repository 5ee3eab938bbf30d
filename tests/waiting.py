"""Waiting for what comes about in another thread or process."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import pytest

PATIENCE_S = 60.0


def wait_for(condition: Callable[[], Any], what: str, patience_s: float = PATIENCE_S) -> Any:
    """What the condition gives as soon as it gives something."""
    end_s = time.monotonic() + patience_s
    while time.monotonic() < end_s:
        if found := condition():
            return found
        time.sleep(0.02)
    return pytest.fail(f"waited {patience_s:g} s for {what}")
