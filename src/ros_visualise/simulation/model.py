"""A world and a robot as one MuJoCo model."""

from __future__ import annotations

from importlib.resources import files
from typing import Any

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.simulation.engine import load_mujoco
from ros_visualise.simulation.flight import Airframe
from ros_visualise.simulation.sensors.camera import vertical_fov
from ros_visualise.simulation.settings import RobotParams
from ros_visualise.simulation.worlds import World

BASE = "base_link"


def compile_model(robot: str, world: World, params: RobotParams) -> Any:
    """The ``mjModel`` of a robot in a world."""
    mujoco = load_mujoco()
    name = f"{robot}.xml"
    assets = {**world.assets, name: (files(__package__) / "models" / name).read_bytes()}
    xml = f'<mujoco model="{robot}"><include file="{name}"/>{world.mjcf}</mujoco>'
    model = mujoco.MjModel.from_xml_string(xml, assets)
    model.cam_fovy[0] = vertical_fov(params)
    model.vis.global_.offwidth = params.camera_width
    model.vis.global_.offheight = params.camera_height
    return model


def bodies_of_robot(model: Any) -> list[int]:
    """Numbers of the bodies that the robot consists of, its base first."""
    base = model.body(BASE).id
    return [number for number in range(model.nbody) if model.body_rootid[number] == base]


def site_position(model: Any, name: str) -> Floats:
    """(3,) metres in the frame of the body that the site is on."""
    return np.array(model.site(name).pos)


def standing_height(model: Any) -> float:
    """Height of ``base_link`` over the ground, metres."""
    return float(model.body(BASE).pos[2])


def read_airframe(model: Any) -> Airframe:
    """Mass, inertia and motors of a quadrotor's model; the four motors are alike."""
    base, motor = model.body(BASE), model.site("motor_front_left")
    jx, jy, jz = base.inertia.tolist()
    return Airframe(
        mass=float(base.subtreemass[0]),
        inertia=(jx, jy, jz),
        arm=float(motor.pos[0]),
        drag=float(model.actuator_gear[0, 5]),
        max_thrust=float(model.actuator_ctrlrange[0, 1]),
    )
