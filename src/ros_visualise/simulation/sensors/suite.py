"""All sensors of one robot, at work."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ros_visualise.data import Transforms
from ros_visualise.simulation.deck import PAD
from ros_visualise.simulation.frames import CameraMount, body_frame, deck_frame
from ros_visualise.simulation.pad import Pad
from ros_visualise.simulation.robot import Robot
from ros_visualise.simulation.schedule import Make, Stream
from ros_visualise.simulation.sensors.barometer import Barometer, BarometerParams
from ros_visualise.simulation.sensors.camera import Camera
from ros_visualise.simulation.sensors.gps import GpsSensor
from ros_visualise.simulation.sensors.imu import ImuSensor
from ros_visualise.simulation.sensors.lidar import Lidar
from ros_visualise.simulation.sensors.magnetometer import Magnetometer, MagnetometerParams
from ros_visualise.simulation.sensors.truth import tell_truth
from ros_visualise.simulation.settings import RobotParams

Measured = Iterator[tuple[str, Any]]


class SensorSuite:
    """The sensors that the settings turn on, as `streams` in the order of equal stamps."""

    def __init__(
        self,
        robot: Robot,
        model: Any,
        data: Any,
        params: RobotParams,
        mount: CameraMount,
        seed: int,
        pad: Pad | None,
    ) -> None:
        self._robot, self._body, self._data = robot, robot.body, data
        self._mount = mount
        self.streams: list[Stream] = []
        self._add("odom", params.odom_rate, self._move, always=True)
        self._add("truth", params.truth_rate, self._tell)
        if pad is not None:
            self._pad = pad
            self._add("pad", params.truth_rate, self._tell_of_pad, always=True)
        self._imu = ImuSensor(params, seed)
        self._add("imu", params.imu_rate, self._feel, always=True)
        if params.gps:
            self._gps = GpsSensor(params, seed)
            self._add("fix", params.gps_rate, self._fix, always=True)
        if isinstance(params, MagnetometerParams):
            self._magnetometer = Magnetometer(params, seed)
            self._add("mag", params.mag_rate, self._sense_field, always=True)
        if isinstance(params, BarometerParams):
            self._barometer = Barometer(params, params.gps_altitude, seed)
            self._add("pressure", params.baro_rate, self._weigh_air, always=True)
        if params.lidar:
            self._lidar = Lidar(params, seed, model, data)
            self._add("points", params.lidar_rate, self._scan)
        self._camera = Camera(params, seed, model)
        if params.camera:
            self._add("image", params.camera_rate, self._look)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of what is measured."""
        return ("tf", *(stream.output for stream in self.streams))

    def close(self) -> None:
        """Free the renderer."""
        self._camera.close()

    def _add(self, output: str, rate_hz: float, make: Make, always: bool = False) -> None:
        self.streams.append(Stream(rate_hz, make, output, always))

    def _move(self, stamp_ns: int, _: int) -> Measured:
        odometry = self._robot.measure_odometry(stamp_ns)
        moving = [body_frame(odometry)]
        if self._mount.gimbal:
            moving.append(self._mount.camera_in_body(stamp_ns, self._body.attitude))
        yield "tf", Transforms(tuple(moving))
        yield "odom", odometry

    def _tell(self, stamp_ns: int, _: int) -> Measured:
        body = self._body
        yield "truth", tell_truth(stamp_ns, body.position, body.attitude, *body.velocity())

    def _tell_of_pad(self, stamp_ns: int, _: int) -> Measured:
        pad = self._pad
        yield "tf", Transforms((deck_frame(stamp_ns, pad.position, pad.attitude),))
        speed = np.array(pad.velocity(stamp_ns / 1e9))
        yield "pad", tell_truth(stamp_ns, pad.position, pad.attitude, speed, np.zeros(3), PAD)

    def _feel(self, stamp_ns: int, _: int) -> Measured:
        yield "imu", self._imu.measure(stamp_ns, self._body.attitude, self._body.motion())

    def _fix(self, stamp_ns: int, _: int) -> Measured:
        yield "fix", self._gps.measure(stamp_ns, self._body.site("gps_link")[0])

    def _sense_field(self, stamp_ns: int, _: int) -> Measured:
        yield "mag", self._magnetometer.measure(stamp_ns, self._body.axes)

    def _weigh_air(self, stamp_ns: int, _: int) -> Measured:
        yield "pressure", self._barometer.measure(stamp_ns, self._body.position[2])

    def _scan(self, stamp_ns: int, index: int) -> Measured:
        place, R = self._body.site("lidar_link")
        yield "points", self._lidar.measure(stamp_ns, index, place, R)

    def _look(self, stamp_ns: int, index: int) -> Measured:
        body = self._body
        place, R = self._mount.optical_in_map(np.array(body.position), body.axes)
        yield "image", self._camera.measure(stamp_ns, index, self._data, place, R)
