"""The shapes of a robot's description."""

import numpy as np
import pytest

from ros_visualise.ui.urdf import read_shapes

DESCRIPTION = """
<robot name="cart">
  <material name="red"><color rgba="1 0 0 1"/></material>
  <link name="base_link">
    <visual><geometry><box size="1 2 3"/></geometry><material name="red"/></visual>
    <visual><geometry><mesh filename="package://cart/body.dae"/></geometry></visual>
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


def test_every_visible_simple_shape_is_found():
    found = read_shapes(DESCRIPTION)
    assert [(one.link, one.kind, one.size) for one in found] == [
        ("base_link", "box", (1, 2, 3)),
        ("wheel_link", "cylinder", (0.2, 0.1)),
        ("mast", "sphere", (0.3,)),
    ]
    assert [one.rgba for one in found] == [(1, 0, 0, 1), (0, 0.5, 0, 1), (0.6, 0.6, 0.6, 1)]


def test_a_shape_stands_where_its_origin_says():
    wheel = read_shapes(DESCRIPTION)[1].T_link_shape
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
    with pytest.raises(ValueError, match="no URDF"):
        read_shapes(text)
