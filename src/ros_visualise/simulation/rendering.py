"""Rendering with OpenGL without a screen."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
import time
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import OpenError
from ros_visualise.data import Floats, Pixels
from ros_visualise.simulation.engine import advise_opengl, load_mujoco

_PROBE_TIMEOUT_S = 60.0


@cache
def choose_backend() -> str:
    """``egl``, ``glfw`` (a window system's) or ``osmesa``: the first that works.

    If ``MUJOCO_GL`` is set, only that is tried. Each is tried in its own process: PyOpenGL cannot
    change its platform later, and a broken driver may crash its process.

    Raises:
        OpenError: none works; the message names what to install.
    """
    asked = os.environ.get("MUJOCO_GL", "").lower().strip()
    if asked in ("disable", "disabled", "off", "false", "0"):
        raise OpenError(f"MUJOCO_GL={asked} disables rendering; unset it, or turn the camera off")
    if sys.platform == "darwin":
        return "cgl"
    if sys.platform == "win32":
        return "glfw"
    asked = {"glx": "glfw"}.get(asked, asked)
    candidates = [asked] if asked in _PLATFORMS else _PLATFORMS
    for name in candidates:
        if (name != "glfw" or os.environ.get("DISPLAY")) and _works(name):
            return name
    raise OpenError(
        f"no OpenGL for the simulated camera ({', '.join(candidates)} tried): {advise_opengl()}"
    )


_PLATFORMS = ["egl", "glfw", "osmesa"]


def _works(name: str) -> bool:
    code = (
        f"from mujoco.{name} import GLContext; import mujoco; c = GLContext(16, 16); "
        "c.make_current(); mujoco.MjrContext(mujoco.MjModel.from_xml_string('<mujoco/>'), 150)"
    )
    environment = {**os.environ, "MUJOCO_GL": name}
    command = [sys.executable, "-c", code]
    try:
        done = subprocess.run(
            command, env=environment, capture_output=True, timeout=_PROBE_TIMEOUT_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0


class Renderer:
    """Renders one MuJoCo model; created, used and closed in one thread.

    Args:
        model: an ``mjModel``.
        size: (width, height) in pixels.

    Raises:
        OpenError: see `choose_backend`.
    """

    def __init__(self, model: Any, size: tuple[int, int]) -> None:
        mujoco = self._mujoco = load_mujoco()
        width, height = size
        self._model = model
        self._rows = np.empty((height, width, 3), np.uint8)
        self._depths = np.empty((height, width), np.float32)
        self._rect = mujoco.MjrRect(0, 0, width, height)
        self._scene = mujoco.MjvScene(model, maxgeom=model.ngeom + 16)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        self._option = mujoco.MjvOption()
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._camera.fixedcamid = 0
        self._gl, self._target = _open_context(mujoco, model, size)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._target)

    def render(
        self, data: Any, position_xyz: Floats, R_map_camera: Floats, with_depth: bool = False
    ) -> Pixels:
        """The image of a camera, (height, width, 3) RGB.

        Args:
            data: an ``mjData`` with positions up to date.
            position_xyz: (3,) metres in the world.
            R_map_camera: 3x3; camera axes x right, y down, z forward.
            with_depth: also measure `inverse_depth`.
        """
        mujoco, camera = self._mujoco, self._camera
        data.cam_xpos[0] = position_xyz
        data.cam_xmat[0] = (R_map_camera * _OPENGL).ravel()
        mask = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(self._model, data, self._option, None, camera, mask, self._scene)
        self._gl.make_current()
        mujoco.mjr_render(self._rect, self._scene, self._target)
        depths = self._depths if with_depth else None
        mujoco.mjr_readPixels(self._rows, depths, self._rect, self._target)
        pixels: Pixels = self._rows[::-1].copy()
        return pixels

    def inverse_depth(self) -> npt.NDArray[np.float32]:
        """(height, width) 1/m, of the last image that was rendered with depth."""
        extent, clip = self._model.stat.extent, self._model.vis.map
        near, far = 1 / (clip.znear * extent), 1 / (clip.zfar * extent)
        return np.asarray(self._depths[::-1] * np.float32(far - near) + np.float32(near))

    def close(self) -> None:
        """Free the driver's memory, which at the end of the process is freed anyway."""
        if sys.is_finalizing():
            return
        self._gl.make_current()
        self._target.free()
        self._gl.free()


def _open_context(mujoco: Any, model: Any, size: tuple[int, int]) -> tuple[Any, Any]:
    """A current OpenGL context, and MuJoCo's context in it."""
    name = choose_backend()
    make = importlib.import_module(f"mujoco.{name}").GLContext
    for rest_s in _RESTS_S:
        context = make(*size)
        try:
            context.make_current()
            return context, mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_50)
        except mujoco.FatalError:
            time.sleep(rest_s)
    raise OpenError(f"OpenGL by {name} failed: {advise_opengl()}")


_RESTS_S = 0.1, 0.3, 1.0, 0.0
"""An X server is unavailable for a moment after its last client left, such as `choose_backend`."""

_OPENGL: npt.NDArray[np.float64] = np.array([1.0, -1.0, -1.0])  # its cameras look along -z, y up
