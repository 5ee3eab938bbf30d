"""Simulated sensors: a file each, with its parameters, outputs, and measurement.

They turn the true state into measurements. Each has its own random numbers, so adding a sensor does
not change the data of others. Another package adds a sensor by an entry point of the group
``ros_visualise.sensors``; see `ros_visualise.core.registry`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar

from ros_visualise.core.params import param
from ros_visualise.core.registry import Registry, holding

if TYPE_CHECKING:
    from ros_visualise.data import Floats
    from ros_visualise.simulation.attitude import Quat
    from ros_visualise.simulation.camera_mount import CameraMount
    from ros_visualise.simulation.pad import Pad
    from ros_visualise.simulation.robot import Robot

P = TypeVar("P")

Measure = Callable[[int, int], Mapping[str, Any]]
"""(stamp_ns, index of the measurement) -> output -> message."""


def setting(default: Any, help: str, **limits: Any) -> Any:
    """A parameter, as `param`; a change restarts the simulation."""
    return param(default, help, restart=True, **limits)


@dataclass(frozen=True)
class Fitting:
    """A robot in its world, to which sensors are fitted.

    ``model`` and ``data`` are MuJoCo's; ``settings`` are the robot's, including those of its
    sensors; ``mount`` is the camera's; functions in ``closing`` are called when the simulation is
    closed.
    """

    robot: Robot
    model: Any
    data: Any
    settings: Any
    seed: int
    mount: CameraMount
    pad: Pad | None = None
    closing: list[Callable[[], None]] = field(default_factory=list)


@dataclass(frozen=True)
class SensorType:
    """A type of sensor.

    Attributes:
        params: its parameters; robots whose settings derive from these have it.
        outputs: names -> types of message; the first one is asked for listeners.
        rate: parameter with its measurements per second.
        fit: gives the measuring function.
        switch: parameter that turns it on; empty: always on.
        always: measure also without listeners, because it has a state.
        standard: every robot gets it.
        delivery: begin of the names of its parameters of delivery; empty: at once. See
            `ros_visualise.simulation.delivery`.
        frames: its frames -> position and attitude in ``base_link``, beside those of the robot.
    """

    params: type
    outputs: Mapping[str, type]
    rate: str
    fit: Callable[[Fitting], Measure]
    switch: str = ""
    always: bool = False
    standard: bool = True
    delivery: str = ""
    frames: Mapping[str, tuple[Floats, Quat]] = field(default_factory=dict)


SENSORS = Registry(
    "sensors",
    __name__,
    holding(SensorType, "SENSOR"),
    first=(
        *("odometry", "truth", "pad", "imu", "gps", "magnetometer", "barometer"),
        *("rangefinder", "optical_flow", "wheel_speed", "lidar", "camera"),
    ),
)
"""All sensors, in the order of simultaneous measurements."""


def sensors_of(settings: Any) -> list[SensorType]:
    """The sensors of a robot with these settings that are switched on."""
    fitted = [one for one in SENSORS.all() if isinstance(settings, one.params)]
    return [one for one in fitted if not one.switch or getattr(settings, one.switch)]


def equipped(params: type[P]) -> type[P]:
    """The settings of a robot, with those of all standard sensors."""
    more = [one.params for one in SENSORS.all() if one.standard]
    more = [one for one in more if not issubclass(params, one)]
    if not more:
        return params
    content = {"__doc__": params.__doc__, "__module__": params.__module__}
    made = type(params.__name__, (*reversed(more), params), content)
    return dataclass(frozen=True)(made)


def outputs_of(params: type) -> dict[str, type]:
    """Outputs of all sensors of a robot with these settings -> their types."""
    sensors = [one for one in SENSORS.all() if issubclass(params, one.params)]
    return {name: kind for one in sensors for name, kind in one.outputs.items()}
