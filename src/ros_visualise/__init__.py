"""See what a robot sees: sensor data through nodes with live sliders, in a browser or on ROS.

``import ros_visualise as rv`` is the Python API; `ros_visualise.api` lists its names, which are
imported when they are first used.
"""

import os
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ros_visualise.api import *  # noqa: F403

    __version__: str

# Libraries read these when they are loaded. Nobody asked for what they would do without them.
os.environ["ORT_DISABLE_TELEMETRY"] = "1"  # onnxruntime reports to its makers over the network
os.environ["MESA_SHADER_CACHE_DISABLE"] = "true"  # OpenGL writes to the home folder: Mesa's ...
os.environ["__GL_SHADER_DISK_CACHE"] = "0"  # ... and NVIDIA's


class _Messages(type(sys)):  # type: ignore[misc]
    """The package of messages, which is called as `ros_visualise.api.messages`."""

    def __call__(self, *given: object, **named: object) -> object:
        from ros_visualise import api

        return api.messages(*given, **named)  # type: ignore[call-overload]


class _Package(type(sys)):  # type: ignore[misc]
    """This package; its public names are those of `ros_visualise.api`."""

    def __setattr__(self, name: str, value: object) -> None:
        if name == "messages":  # set when the package of this name is imported
            value.__class__ = _Messages
        super().__setattr__(name, value)

    def __getattr__(self, name: str) -> object:
        if name == "__version__":
            from importlib.metadata import version

            return version("ros_visualise")
        is_room = os.path.isdir(os.path.join(os.path.dirname(__file__), name))
        is_room = is_room and name != "messages"  # a room and a function
        if not name.startswith("_") and not is_room:
            from ros_visualise import api

            if name in api.__all__:
                return getattr(api, name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

    def __dir__(self) -> list[str]:
        from ros_visualise import api

        return [*globals(), "__version__", *api.__all__]


sys.modules[__name__].__class__ = _Package
