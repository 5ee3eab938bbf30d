"""Check of the installation: all packages are there and fit together."""

from __future__ import annotations

import sys
from contextlib import redirect_stderr
from importlib.util import find_spec
from io import StringIO
from pathlib import Path

from ros_visualise.core.errors import OpenError

_FROM_PIP = ("numpy", "av", "rosbags", "nicegui")


def check_installation() -> None:
    """Import OpenCV, which everything needs and which must fit the installed NumPy.

    Raises:
        OpenError: it cannot be imported, or what pip brings is missing.
    """
    if missing := [name for name in _FROM_PIP if find_spec(name) is None]:
        raise OpenError(
            f"not installed: {', '.join(missing)}; in a workspace,"
            f" {_pip_install()} -e 'src/ros_visualise[system,sim,detect]'"
        )
    said = StringIO()
    try:
        with redirect_stderr(said):  # NumPy writes a page about what was built for another one
            import cv2  # noqa: F401
    except ImportError as error:
        raise OpenError(_advice(error)) from None
    sys.stderr.write(said.getvalue())


def _advice(error: ImportError) -> str:
    if error.name == "cv2":
        return f"no OpenCV: apt install python3-opencv, or {_pip_install()} opencv-python-headless"
    if "multiarray" in error.msg:
        from numpy import __version__

        return f"this OpenCV was not built for NumPy {__version__}: {_pip_install()} 'numpy<2'"
    reason = error.msg.splitlines()[0]
    return f"OpenCV cannot be loaded ({reason}): apt install libgl1 libglib2.0-0 libsm6 libxext6"


def _pip_install() -> str:
    """The command, as the distribution's own Python (PEP 668) or another takes it."""
    import sysconfig

    is_managed = Path(sysconfig.get_path("stdlib"), "EXTERNALLY-MANAGED").exists()
    in_venv = sys.prefix != sys.base_prefix
    options = " --user --break-system-packages" if is_managed and not in_venv else ""
    return f"{sys.executable} -m pip install{options}"
