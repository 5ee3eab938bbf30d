"""The URDF of a robot, generated from its model, for rviz and other tools."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree as Xml

import numpy as np

from ros_visualise.data import Floats, Text, Transforms
from ros_visualise.geometry.rotations import to_rpy
from ros_visualise.simulation.model import BASE, bodies_of_robot

_SHOWN_GROUP = 2
_PLANE, _SPHERE, _CAPSULE, _CYLINDER, _BOX = 0, 2, 3, 5, 6  # mjtGeom


def describe(model: Any, fixed: Transforms) -> Text:
    """The URDF: links with masses and shapes, joined by the fixed transforms.

    A camera on a gimbal has a floating joint. Wheels are fixed, as no joint states are published.
    """
    name = str(model.names[: model.names.index(b"\0")].decode()) or "robot"
    robot = Xml.Element("robot", name=name)
    bodies = {_link_of(model, n): n for n in bodies_of_robot(model)}
    joints = {t.child_frame_id: t for t in fixed.transforms if t.header.frame_id != "map"}
    links = [BASE, *joints, *({"camera_link"} - {*joints})]
    for link in links:
        element = Xml.SubElement(robot, "link", name=link)
        if link in bodies:
            _add_body(element, model, bodies[link])
    for child in links[1:]:
        moves = child not in joints
        joint = Xml.SubElement(
            robot, "joint", name=f"{child}_joint", type="floating" if moves else "fixed"
        )
        Xml.SubElement(joint, "parent", link=BASE if moves else joints[child].header.frame_id)
        Xml.SubElement(joint, "child", link=child)
        if not moves:
            _add_origin(joint, joints[child].translation_xyz, joints[child].quat_xyzw)
    Xml.indent(robot)
    return Text(Xml.tostring(robot, encoding="unicode"))


def _link_of(model: Any, body: int) -> str:
    return BASE if body == 1 else f"{model.body(body).name}_link"


def _add_body(link: Xml.Element, model: Any, body: int) -> None:
    inertial = Xml.SubElement(link, "inertial")
    _add_origin(inertial, model.body_ipos[body], np.roll(model.body_iquat[body], -1))
    Xml.SubElement(inertial, "mass", value=f"{model.body_mass[body]:g}")
    ixx, iyy, izz = (f"{value:g}" for value in model.body_inertia[body])
    Xml.SubElement(inertial, "inertia", ixx=ixx, ixy="0", ixz="0", iyy=iyy, iyz="0", izz=izz)
    for geom in range(model.ngeom):
        if model.geom_bodyid[geom] == body and model.geom_group[geom] == _SHOWN_GROUP:
            _add_shape(link, model, geom)


def _add_shape(link: Xml.Element, model: Any, geom: int) -> None:
    visual = Xml.SubElement(link, "visual")
    _add_origin(visual, model.geom_pos[geom], np.roll(model.geom_quat[geom], -1))
    geometry = Xml.SubElement(visual, "geometry")
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    if kind == _BOX:
        Xml.SubElement(geometry, "box", size=" ".join(f"{2 * s:g}" for s in size))
    elif kind == _SPHERE:
        Xml.SubElement(geometry, "sphere", radius=f"{size[0]:g}")
    elif kind in (_CYLINDER, _CAPSULE):
        Xml.SubElement(geometry, "cylinder", radius=f"{size[0]:g}", length=f"{2 * size[1]:g}")
    else:
        raise ValueError(f"unsupported geom type in URDF: {kind}")
    painted = model.geom_matid[geom]
    rgba = model.geom_rgba[geom] if painted < 0 else model.mat_rgba[painted]
    look = " ".join(f"{value:g}" for value in rgba)
    material = Xml.SubElement(visual, "material", name=f"colour_{look.replace(' ', '_')}")
    Xml.SubElement(material, "color", rgba=look)


def _add_origin(parent: Xml.Element, position: Any, quat_xyzw: Floats) -> None:
    xyz = " ".join(f"{value:g}" for value in position)
    rpy = " ".join(f"{value:g}" for value in to_rpy(quat_xyzw))
    Xml.SubElement(parent, "origin", xyz=xyz, rpy=rpy)
