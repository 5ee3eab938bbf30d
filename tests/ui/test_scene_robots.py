"""Robot models: what a URDF holds, and how it is drawn."""

from typing import Any

import numpy as np
import pytest
import trimesh
from scene_messages import draw, is_at, tf, transform

from ros_visualise.core.errors import OpenError
from ros_visualise.data import JointState, Odometry, Text, Transforms
from ros_visualise.ui.scene.meshes import load_mesh
from ros_visualise.ui.scene.scene import Scene
from ros_visualise.ui.scene.urdf import read_model, read_urdf

DESCRIPTION = """
<robot name="cart">
  <material name="red"><color rgba="1 0 0 1"/></material>
  <link name="base_link">
    <visual><geometry><box size="1 2 3"/></geometry><material name="red"/></visual>
    <visual><geometry><mesh filename="package://cart/body.dae" scale="1 1 2"/></geometry></visual>
    <collision><geometry><sphere radius="9"/></geometry></collision>
  </link>
  <link name="wheel_link">
    <visual>
      <origin xyz="0 0.5 0" rpy="1.5707963 0 0"/>
      <geometry><cylinder radius="0.2" length="0.1"/></geometry>
      <material name="own"><color rgba="0 0.5 0 1"/></material>
    </visual>
  </link>
  <link name="mast"><visual><geometry><sphere radius="0.3"/></geometry></visual></link>
</robot>
"""


def test_every_visible_shape_is_found():
    found = read_model(DESCRIPTION).shapes
    assert [(one.link, one.kind, one.size) for one in found] == [
        ("base_link", "box", (1, 2, 3)),
        ("base_link", "mesh", (1, 1, 2)),
        ("wheel_link", "cylinder", (0.2, 0.1)),
        ("mast", "sphere", (0.3,)),
    ]
    assert [one.rgba for one in found] == [
        (1, 0, 0, 1),
        (0.6, 0.6, 0.6, 1),
        (0, 0.5, 0, 1),
        (0.6, 0.6, 0.6, 1),
    ]
    assert found[1].mesh == "package://cart/body.dae"


def test_a_shape_stands_where_its_origin_says():
    wheel = read_model(DESCRIPTION).shapes[2].T_link_shape
    np.testing.assert_allclose(wheel[:3, 3], [0, 0.5, 0])
    np.testing.assert_allclose(wheel[:3, 2], [0, -1, 0], atol=1e-6)  # its axis, turned about x


@pytest.mark.parametrize(
    "text",
    [
        "",
        "not xml",
        DESCRIPTION.replace('name="mast"', ""),
        DESCRIPTION.replace('size="1 2 3"', ""),
        DESCRIPTION.replace('radius="0.3"', 'radius="x"'),
    ],
)
def test_what_is_no_description_is_refused(text):
    with pytest.raises(ValueError, match="not a valid URDF"):
        read_model(text)


def test_materials_without_names_color_their_own_shape_alone():
    found = read_model("""
    <robot name="r"><link name="a">
      <visual><geometry><sphere radius="1"/></geometry>
        <material><color rgba="1 0 0 1"/></material></visual>
      <visual><geometry><sphere radius="2"/></geometry>
        <material name=""><color rgba="0 1 0 1"/></material></visual>
      <visual><geometry><sphere radius="3"/></geometry></visual>
      <visual><geometry><sphere radius="4"/></geometry><material/></visual>
    </link></robot>""").shapes
    gray = (0.6, 0.6, 0.6, 1)
    assert [one.rgba for one in found] == [(1, 0, 0, 1), (0, 1, 0, 1), gray, gray]


WRONG_NUMBERS = {
    '<box size="1 2"/>': r"link a, box: size must be 3 numbers, not '1 2'",
    '<box size="1 2 3 4"/>': r"link a, box: size must be 3 numbers, not '1 2 3 4'",
    '<box size="1 2 nan"/>': r"size must be 3 numbers",
    "<box/>": r"link a, box: size must be 3 numbers, not ''",
    '<sphere radius="1 2"/>': r"link a, sphere: radius must be a number, not '1 2'",
    '<cylinder radius="1"/>': r"link a, cylinder: length must be a number, not ''",
}


@pytest.mark.parametrize(("shape", "why"), WRONG_NUMBERS.items(), ids=WRONG_NUMBERS)
def test_a_shape_with_other_numbers_is_named(shape, why):
    visual = f"<visual><geometry>{shape}</geometry></visual>"
    with pytest.raises(ValueError, match=why):
        read_model(f'<robot name="r"><link name="a">{visual}</link></robot>')


def test_an_origin_or_a_color_with_other_numbers_is_refused():
    for wrong in ('<origin xyz="1 2"/>', '<material><color rgba="1 0 0"/></material>'):
        visual = f'<visual>{wrong}<geometry><sphere radius="1"/></geometry></visual>'
        with pytest.raises(ValueError, match=r"must be . numbers"):
            read_model(f'<robot name="r"><link name="a">{visual}</link></robot>')


ENTITIES = """<!DOCTYPE robot [<!ENTITY a "aaaaaaaaaa"><!ENTITY b SYSTEM "file:///etc/passwd">]>
<robot name="r"><link name="&b;"/></robot>"""


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (ENTITIES, "document type"),
        ('<robot xmlns:x="http://www.ros.org/wiki/xacro"><x:macro/></robot>', "xacro FILE >"),
        (f"<robot name='r'><!--{'a' * (4 << 20)}--></robot>", "larger than 4 MiB"),
        (f"<robot>{DESCRIPTION[DESCRIPTION.find('<link') : -9] * 300}</robot>", "more than 1000"),
        ("<robot><joint name='j'><parent link='a'/></joint></robot>", "a parent and a child"),
    ],
    ids=["entities", "xacro", "long", "many", "loose joint"],
)
def test_a_hostile_description_is_rejected(text, why):
    with pytest.raises(ValueError, match=why):
        read_model(text)


ARM = """<robot name="arm">
  <link name="finger"><visual><geometry><sphere radius="0.1"/></geometry></visual></link>
  <link name="thumb"><visual><geometry><sphere radius="0.1"/></geometry></visual></link>
  <link name="upper"><visual><geometry><box size="1 1 1"/></geometry></visual></link>
  <link name="base"/>
  <joint name="slide" type="prismatic"><parent link="upper"/><child link="finger"/>
    <axis xyz="0 0 2"/></joint>
  <joint name="other" type="prismatic"><parent link="upper"/><child link="thumb"/>
    <axis xyz="0 0 1"/><mimic joint="slide" multiplier="-2" offset="0.5"/></joint>
  <joint name="turn" type="continuous"><origin xyz="1 0 0"/><parent link="base"/>
    <child link="upper"/><axis xyz="0 1 0"/></joint>
</robot>"""


def test_links_follow_their_frames_and_else_their_joints(scene, look):
    draw(scene, robot_description=Text(ARM))
    look("topics/robot_description/upper", is_at([1, 0, 0]))
    joints = JointState(("turn", "slide", "no"), np.array([np.pi / 2, 0.25, np.nan]))
    draw(scene, joint_states=joints)
    look("topics/robot_description/finger", is_at([1.25, 0, 0]))
    look("topics/robot_description/thumb", is_at([1, 0, 0]))  # 0.5 m - 2 * 0.25 m
    draw(scene, tf=tf(transform("map", "base", [0, 5, 0]), transform("map", "finger", [9, 9, 9])))
    look("topics/robot_description/upper", is_at([1, 5, 0]))
    look("topics/robot_description/finger", is_at([9, 9, 9]))


def test_joints_in_a_circle_are_not_drawn(scene, look):
    circle = """<robot name="r"><link name="a"><visual><geometry><sphere radius="1"/></geometry>
    </visual></link><link name="b"/>
    <joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint>
    <joint name="k" type="fixed"><parent link="b"/><child link="a"/></joint></robot>"""
    draw(scene, robot_description=Text(circle))
    assert look("topics/robot_description/a")["visible"] is False


def test_joint_states_of_other_lengths_are_damaged():
    with pytest.raises(ValueError, match="2 values for 1 joints"):
        JointState(("a",), np.zeros(2))


@pytest.fixture
def package(tmp_path):
    """A robot's package: a body in two colours and inches, a wheel, and its URDF."""
    meshes = tmp_path / "ws" / "cart" / "meshes"
    meshes.mkdir(parents=True)
    body = trimesh.creation.box([100, 40, 20])
    lid = trimesh.creation.box([10, 10, 10]).apply_translation([0, 0, 15])
    for mesh, color in ((body, [200, 20, 20, 255]), (lid, [20, 20, 200, 255])):
        material = trimesh.visual.material.PBRMaterial(baseColorFactor=color, roughnessFactor=1.0)
        mesh.visual = trimesh.visual.TextureVisuals(material=material)
    data = trimesh.exchange.dae.export_collada([body, lid]).decode()
    inches = data.replace('<unit meter="1.0"', '<unit meter="0.0254"')
    if inches == data:
        inches = data.replace("<asset>", '<asset><unit name="inch" meter="0.0254"/>', 1)
    (meshes / "body.dae").write_text(inches)
    trimesh.creation.cylinder(200, 100).export(meshes / "wheel.stl")
    (meshes / "mast.obj").write_text("mtllib none.mtl\nv 0 0 0\nv 1 0 0\nv 0 0 3\nf 1 2 3\n")
    urdf = tmp_path / "ws" / "cart" / "urdf" / "cart.urdf"
    urdf.parent.mkdir()
    visual = "<visual><geometry><mesh {}/></geometry>{}</visual>"
    green = '<material name="g"><color rgba="0 1 0 1"/></material>'
    urdf.write_text(
        '<robot name="cart"><link name="base_link">'
        + visual.format('filename="package://cart/meshes/body.dae"', green)
        + visual.format('filename="package://cart/meshes/wheel.stl" scale=".001 .001 .001"', green)
        + visual.format('filename="../meshes/mast.obj"', "")
        + "</link></robot>"
    )
    return urdf


def drawn(look: Any, name: str) -> tuple[list[float], list[int]]:
    """The size of a mesh, and its colour."""
    node = look(name)
    sizes = np.ptp(node["vertices"], axis=0)
    return [round(float(size), 4) for size in sizes], list(node["colors"])


def test_a_robot_of_meshes_is_drawn_from_a_file(tree, look, package):
    scene = Scene(tree, urdf=read_urdf(package))
    scene.follow({"/odom": Odometry, "/tf": Transforms, "/robot_description": Text})
    scene.refresh()
    assert scene.problems == {}
    link = "topics/--urdf/base_link"
    assert drawn(look, f"{link}/0/mesh") == ([2.54, 1.016, 0.508], [200, 20, 20])
    assert drawn(look, f"{link}/0/mesh/1") == ([0.254, 0.254, 0.254], [20, 20, 200])
    size, color = drawn(look, f"{link}/1/mesh")
    assert np.allclose(size, [0.4, 0.4, 0.1], atol=5e-3)
    assert color == [0, 255, 0]
    assert drawn(look, f"{link}/2/mesh") == ([1, 0, 3], [153, 153, 153])
    draw(scene, robot_description=Text(ARM))
    assert scene.is_covered("/robot_description")


def test_missing_meshes_are_named_and_the_others_drawn(scene, look, package, monkeypatch, caplog):
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(package.parent.parent.parent))
    (package.parent.parent / "meshes" / "body.dae").unlink()
    draw(scene, robot_description=Text(package.read_text()))
    look("topics/robot_description/base_link/1/mesh")
    why = scene.problems["/robot_description"]
    assert why.startswith("2 of 3 meshes are missing: package://cart/meshes/body.dae: no such file")
    assert caplog.text.count(why) == 1
    draw(scene, robot_description=Text(package.read_text()))
    assert caplog.text.count(why) == 1


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ('<!DOCTYPE COLLADA [<!ENTITY a "b">]><COLLADA>&a;</COLLADA>', "document type"),
        ("<COLLADA><asset><unit meter='inf'/></asset></COLLADA>", "damaged COLLADA"),
        ("<COLLADA><asset><unit meter='x'/></asset></COLLADA>", "cannot be read"),
        ("PK\x03\x04", "cannot be read"),
    ],
)
def test_a_hostile_collada_file_is_rejected(tmp_path, text, why):
    (tmp_path / "a.dae").write_text(text)
    with pytest.raises(ValueError, match=why):
        load_mesh((tmp_path / "a.dae").as_uri())


@pytest.mark.parametrize(
    ("content", "why"),
    [(None, "No such file"), ("<robot", "not a valid URDF"), ("\0\1", "not a valid URDF")],
)
def test_a_file_without_a_robot_is_rejected(tmp_path, content, why):
    if content is not None:
        (tmp_path / "a.urdf").write_text(content)
    with pytest.raises(OpenError, match=why):
        read_urdf(tmp_path / "a.urdf")


def test_a_file_names_no_meshes_outside_of_its_packages(tmp_path):
    (tmp_path / "secret.stl").write_bytes(bytes(84))
    (tmp_path / "cart").mkdir()
    path = tmp_path / "cart" / "cart.urdf"
    mesh = '<visual><geometry><mesh filename="package://cart/../secret.stl"/></geometry></visual>'
    path.write_text(f'<robot name="r"><link name="a">{mesh}</link></robot>')
    assert "package://cart/../secret.stl" in read_urdf(path)
