"""Robots simulated by MuJoCo: a skid-steered rover and a quadrotor, with their sensors."""

from ros_visualise.simulation.missions import SHAPES, Mission, read_mission
from ros_visualise.simulation.schedule import Output
from ros_visualise.simulation.settings import HuskyParams, QuadrotorParams, RobotParams
from ros_visualise.simulation.simulator import PARAMS, Simulation
from ros_visualise.simulation.worlds import WORLDS

__all__ = [
    "PARAMS",
    "SHAPES",
    "WORLDS",
    "HuskyParams",
    "Mission",
    "Output",
    "QuadrotorParams",
    "RobotParams",
    "Simulation",
    "read_mission",
]
