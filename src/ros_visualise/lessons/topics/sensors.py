"""A robot's sensors: their measurements and noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ros_visualise.core.params import param
from ros_visualise.data import Floats, Imu, MarkerArray, Message
from ros_visualise.lessons import car
from ros_visualise.lessons.lesson import GIVES, WIDTH, Lesson, Step, show_at
from ros_visualise.lessons.methods.allan import OF_BIAS, allan_deviation, random_walk, slope_of
from ros_visualise.nodes import node
from ros_visualise.plotting.axes import PlotAxes
from ros_visualise.plotting.colors import BLUE, GREEN, RED
from ros_visualise.plotting.figure import Figure

_PERIOD_S = 1.0
_GROWS = 0.02
_MOST, _DROPPED = 200_000, 20_000  # largest number of samples, and number dropped at once
_GAP = 5  # periods without a measurement
_LEAST = 100
_WHITE_SLOPE, _SLOPE_ERROR = -0.5, 0.25  # of the curve on logarithmic scales


@node("car", inputs={"imu": Imu}, outputs={**GIVES, "markers": MarkerArray}, latched=("markers",))
class Car:
    """KITTI's car and its sensors."""

    def __init__(self, _: object) -> None:
        self._is_shown = False

    def step(self, imu: Imu, params: object) -> dict[str, Message] | None:
        """Once: it does not change."""
        if self._is_shown:
            return None
        self._is_shown = True
        text = """
            A robot knows only what its sensors measure. A passive sensor only receives signals; an
            active one sends something out and measures what comes back. The car of KITTI, a data
            set that is used to compare many methods, has these sensors:

                camera     passive  light, 10 Hz
                Velodyne   active   laser echoes, 10 Hz
                GPS (RTK)  passive  radio signals, 10 Hz
                IMU        passive  rotation, forces, 100 Hz

            A camera has 1392 × 512 pixels, and sees nothing in the dark. The Velodyne measures
            about 100000 points per revolution, up to 120 m away. GPS with corrections (RTK) is
            accurate to 5 cm under open sky. The IMU measures rotation and acceleration everywhere,
            but a pose computed from it drifts.

            None of them is enough alone: a camera does not know the scale, a laser sees no colours,
            GPS has no signal in tunnels, and the IMU drifts. The 3D view shows the car around the
            IMU of this run, if tf has its frame.
            """
        markers = car.markers(imu.header.frame_id)
        return {**show_at(imu.header, car.figure(), text), "markers": markers}


@dataclass(frozen=True)
class MeasuredParams:
    """The time range to show."""

    seconds: float = param(10.0, "time range up to now, seconds", min=1, max=600, slider=(1, 60))


class _Samples:
    """Samples of an IMU.

    Args:
        grows: show the next result after a second, and after the time grew by this fraction.
    """

    def __init__(self, grows: float = 0.0) -> None:
        self._grows = grows
        self._rows = np.empty((_MOST, 7))  # seconds since the first; angular velocity, acceleration
        self._count = 0
        self._first_ns = 0
        self._due_s = 0.0

    def add(self, imu: Imu) -> bool:
        """Add a measurement; True if the next result is due."""
        if not self._count:
            self._first_ns = imu.header.stamp_ns
        time_s = (imu.header.stamp_ns - self._first_ns) / 1e9
        if self._count and time_s <= self._rows[self._count - 1, 0]:
            return False
        if self._count == _MOST:  # the oldest go
            self._count -= _DROPPED
            self._rows[: self._count] = self._rows[_DROPPED:]
        self._rows[self._count] = [time_s, *imu.angular_xyz, *imu.linear_xyz]
        self._count += 1
        if time_s < self._due_s and self.is_enough:
            return False
        self._due_s = time_s + max(_PERIOD_S, self._grows * time_s)
        return True

    @property
    def is_enough(self) -> bool:
        """True if there are enough samples."""
        return self._count >= _LEAST

    @property
    def times_s(self) -> Floats:
        """Seconds since the first, (N,)."""
        return self._rows[: self._count, 0]

    @property
    def values(self) -> Floats:
        """(N, 6) rad/s and m/s^2."""
        return self._rows[: self._count, 1:]

    @property
    def period_s(self) -> float:
        """Median interval, seconds."""
        return float(np.median(np.diff(self.times_s)))

    @property
    def covered_s(self) -> float:
        """Measured time of the samples in memory, seconds, without gaps."""
        steps = np.diff(self.times_s)
        return float(steps[steps < _GAP * self.period_s].sum())

    def wait(self, imu: Imu) -> dict[str, Message]:
        """The answer while there are too few samples."""
        figure = Figure(WIDTH, 120)
        told = f"{self._count} of {_LEAST} measurements needed"
        figure.text(WIDTH / 2, 40, told, 16, "middle", RED)
        figure.text(WIDTH / 2, 80, "(10 s of a KITTI drive)", 14, "middle")
        text = f"""
            {self._count} measurements so far; at least {_LEAST} are needed. KITTI's drives have
            10 per second, so choose one of 10 s or more, or any other recording
            with an IMU.
            """
        return show_at(imu.header, figure, text)


@node("measured", params=MeasuredParams, inputs={"imu": Imu}, outputs=GIVES)
class ImuReadings:
    """Measurements of the IMU."""

    def __init__(self, _: MeasuredParams) -> None:
        self._samples = _Samples()

    def reset(self) -> None:
        self._samples = _Samples()

    def step(self, imu: Imu, params: MeasuredParams) -> dict[str, Message] | None:
        """Every second: the latest measurements."""
        if not self._samples.add(imu):
            return None
        if not self._samples.is_enough:
            return self._samples.wait(imu)
        times, values = self._samples.times_s, self._samples.values
        recent = times >= times[-1] - params.seconds
        mean, spread = values[recent].mean(axis=0), values[recent].std(axis=0)
        text = f"""
            The IMU of this run gives {1 / self._samples.period_s:.0f} measurements per second. In
            the last {min(params.seconds, times[-1]):.0f} s:

                angular velocity, rad/s
                mean {_three(mean[:3])}
                dev. {_three(spread[:3])}
                acceleration, m/s²
                mean {_three(mean[3:])}
                dev. {_three(spread[3:])}

            For a sensor at rest the angular velocity should be zero, and the acceleration 9.81 m/s²
            upwards: an accelerometer feels the ground push against its weight. If the means differ
            from these values, the difference is the bias. The deviation (dev.) comes from noise and
            from the robot's own motion.
            """
        return show_at(imu.header, _draw_measured(times[recent], values[recent]), text)


@node("allan", inputs={"imu": Imu}, outputs=GIVES)
class Allan:
    """The Allan deviation of the IMU."""

    def __init__(self, _: object) -> None:
        self.reset()

    def reset(self) -> None:
        self._samples = _Samples(_GROWS)

    def step(self, imu: Imu, params: object) -> dict[str, Message] | None:
        """Every second, later less often: from all measurements so far."""
        if not self._samples.add(imu):
            return None
        if not self._samples.is_enough:
            return self._samples.wait(imu)
        period_s = self._samples.period_s
        times_s, deviation = allan_deviation(self._samples.values, period_s)
        if not (deviation > 0).all() or len(times_s) < 2:
            return None
        gyro, force = deviation[:, :3].mean(axis=1), deviation[:, 3:].mean(axis=1)
        text = """
            Averaging reduces noise, but for how long should one average? The Allan deviation
            compares each mean over a time τ with the mean over the next τ:

                σ²(τ) = ½ ⟨ (mean over the next τ
                             − mean over this τ)² ⟩

            With white noise, σ falls as N / √τ. Then comes a floor: longer averages do not help.
            The floor divided by {ratio} is the bias instability. After that the curve rises,
            because the bias changes. From {count} measurements in {seconds:.0f} s:

                gyroscope, rad/s
            {gyro}
                accelerometer, m/s²
            {force}

            This is valid only for a sensor at rest: the motion of a robot looks like noise here.
            The longer the recording, the farther the curve goes to the right.
            """
        return show_at(
            imu.header,
            _draw_allan(times_s, gyro, force),
            text,
            count=len(self._samples.values),
            seconds=self._samples.covered_s,
            ratio=OF_BIAS,
            gyro=_about_noise(times_s, gyro),
            force=_about_noise(times_s, force),
        )


LESSON = Lesson(
    "sensors",
    "a robot's sensors: those of KITTI's car, what an IMU measures, and its Allan deviation",
    "",
    [Step(Car), Step(ImuReadings), Step(Allan)],
    sample=("husky", {"world": "plane", "mission": "none", "camera": False, "lidar": False}),
    streams=True,
    plays=True,
    export_s=30.0,
)


def _about_noise(times_s: Floats, deviation: Floats) -> str:
    """Lines with the noise density and the floor, as far as the curve shows them."""
    slope = slope_of(times_s, deviation)
    if abs(slope - _WHITE_SLOPE) > _SLOPE_ERROR:
        return f"        no white noise: slope {slope:+.2f}, not −0.5"
    lines = [f"N = {random_walk(times_s, deviation):.2e} /√Hz"]
    lowest = int(deviation.argmin())
    floor, time_s = deviation[lowest], times_s[lowest]
    if lowest == len(times_s) - 1:
        lines.append(f"floor not reached; lowest so far {floor:.2e}, at {time_s:.3g} s")
    else:
        lines.append(f"floor = {floor:.2e} at {time_s:.3g} s")
        lines.append(f"floor / {OF_BIAS} = {floor / OF_BIAS:.2e}")
    return "\n".join(f"        {line}" for line in lines).strip("\n")


def _three(values: Floats) -> str:
    return "(" + ", ".join(f"{one:.4f}" for one in values) + ")"


def _draw_measured(times_s: Floats, values: Floats) -> Figure:
    figure = Figure(WIDTH, 460)
    for number, (name, three) in enumerate(
        (("angular velocity (rad/s): x red, y green, z blue", values[:, :3]),
         ("acceleration (m/s^2)", values[:, 3:]))
    ):  # fmt: skip
        low = np.array([times_s[0], three.min()])
        high = np.array([times_s[-1], three.max()])
        axes = PlotAxes(figure, (70, 30 + 225 * number, WIDTH - 90, 150), low, high)
        axes.draw("time (s)", name)
        for column, color in zip(three.T, (RED, GREEN, BLUE), strict=True):
            axes.curve(np.stack([times_s, column], axis=1), color, 1)
    return figure


def _draw_allan(times_s: Floats, gyro: Floats, force: Floats) -> Figure:
    """Both on logarithmic scales, and the slope of white noise, gray."""
    figure = Figure(WIDTH, 480)
    across = np.log10(times_s)
    curves = [
        (np.log10(gyro), BLUE, "gyroscope (rad/s)"),
        (np.log10(force), RED, "accelerometer (m/s^2)"),
    ]
    every = np.concatenate([curve for curve, _, _ in curves])
    low, high = np.array([across[0], every.min()]), np.array([across[-1], every.max()])
    axes = PlotAxes(figure, (70, 50, WIDTH - 90, 370), low, high)
    axes.draw("log10 of the time t (s)", "log10 of the Allan deviation")
    for number, (curve, color, name) in enumerate(curves):
        white = curve[0] - (across - across[0]) / 2
        is_inside = white >= low[1]
        axes.curve(np.stack([across, white], axis=1)[is_inside], (190, 190, 190), 1.2)
        axes.curve(np.stack([across, curve], axis=1), color, 2.5)
        figure.text(WIDTH - 30, 24 + 18 * number, name, 13, "end", color)
    return figure
