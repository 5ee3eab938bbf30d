"""A sensor of simulated robots: it is colder higher up."""

from dataclasses import dataclass

from ros_visualise.data import Header, Number
from ros_visualise.simulation.noise import random_of
from ros_visualise.simulation.sensors import Fitting, Measure, SensorType, setting


@dataclass(frozen=True)
class ThermometerParams:
    thermometer_rate: float = setting(2.0, "measurements per second", min=0.1, max=100)
    thermometer_noise: float = setting(0.1, "noise (standard deviation), K", min=0, max=10)


def fit(fitting: Fitting) -> Measure:
    """The sensor on the body: 288 K at the ground, 6.5 K less in each kilometre."""
    random = random_of(fitting.seed, "thermometer")
    body, noise_k = fitting.robot.body, fitting.settings.thermometer_noise

    def measure(stamp_ns: int, _: int) -> dict[str, Number]:
        kelvin = 288.15 - 0.0065 * body.position[2] + noise_k * random.standard_normal()
        return {"temperature": Number(float(kelvin), Header(stamp_ns))}

    return measure


SENSOR = SensorType(ThermometerParams, {"temperature": Number}, "thermometer_rate", fit)
