"""MuJoCo, brought in when a simulation starts: nothing else needs it."""

from __future__ import annotations

import importlib
from typing import Any

from ros_visualise.errors import OpenError


def load_mujoco() -> Any:
    """The module ``mujoco``.

    Raises:
        OpenError: it is not installed, or too old.
    """
    try:
        mujoco = importlib.import_module("mujoco")
    except ImportError as error:
        raise OpenError(f"the simulator needs MuJoCo ({error}): {_INSTALL}") from None
    if tuple(map(int, mujoco.__version__.split(".")[:2])) < (3, 5):
        raise OpenError(f"the simulator needs MuJoCo 3.5, not {mujoco.__version__}: {_INSTALL}")
    return mujoco


_INSTALL = "pip install 'ros_visualise[sim]'"
