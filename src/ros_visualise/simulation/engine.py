"""Import of MuJoCo, only when a simulation starts."""

from __future__ import annotations

import importlib
import logging
import os
from typing import Any

from ros_visualise.core.errors import OpenError

log = logging.getLogger(__name__)


def load_mujoco() -> Any:
    """The module ``mujoco``.

    Raises:
        OpenError: it is missing or too old, or MUJOCO_GL is invalid on this machine.
    """
    advice = advise_opengl()
    try:
        mujoco = importlib.import_module("mujoco")
    except ImportError as error:
        raise OpenError(f"the simulator needs MuJoCo ({error}): {_INSTALL}") from None
    except (AttributeError, OSError, RuntimeError):  # from PyOpenGL without the platform's library
        asked = os.environ.get("MUJOCO_GL", "")
        raise OpenError(f"MUJOCO_GL={asked} does not work on this machine: {advice}") from None
    if tuple(map(int, mujoco.__version__.split(".")[:2])) < (3, 5):
        raise OpenError(f"the simulator needs MuJoCo 3.5, not {mujoco.__version__}: {_INSTALL}")
    mujoco.set_mju_user_warning(_warn)  # or it writes MUJOCO_LOG.TXT to the current folder
    return mujoco


def _warn(text: str) -> None:
    log.warning("MuJoCo: %s", text)


def advise_opengl() -> str:
    """Advice on installing OpenGL."""
    unset = "unset MUJOCO_GL, or " if os.environ.get("MUJOCO_GL") else ""
    return f"{unset}apt install libegl1 libgl1 libgl1-mesa-dri, or libosmesa6"


_INSTALL = "pip install 'ros_visualise[sim]' (in a clone: pip install '.[sim]')"
