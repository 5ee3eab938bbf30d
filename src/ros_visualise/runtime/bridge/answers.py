"""What our services answer, on any graph."""

from __future__ import annotations

from collections.abc import Callable

from ros_visualise.core import supervision
from ros_visualise.core.errors import RosVisualiseError


def answer(act: Callable[[], str | None]) -> tuple[bool, str]:
    """Whether something was done, and what is said of it.

    Args:
        act: does it; what it returns is said, or the error that it raises.
    """
    try:
        return True, act() or ""
    except (RosVisualiseError, ValueError) as error:
        return False, str(error)
    except supervision.ERRORS as error:
        supervision.note("service", error)
        return False, f"failed: {type(error).__name__}: {error}"
