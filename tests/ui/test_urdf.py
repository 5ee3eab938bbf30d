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


def test_materials_without_names_color_their_own_shape_alone():
    found = read_shapes("""
    <robot name="r"><link name="a">
      <visual><geometry><sphere radius="1"/></geometry>
        <material><color rgba="1 0 0 1"/></material></visual>
      <visual><geometry><sphere radius="2"/></geometry>
        <material name=""><color rgba="0 1 0 1"/></material></visual>
      <visual><geometry><sphere radius="3"/></geometry></visual>
      <visual><geometry><sphere radius="4"/></geometry><material/></visual>
    </link></robot>""")
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
        read_shapes(f'<robot name="r"><link name="a">{visual}</link></robot>')


def test_an_origin_or_a_color_with_other_numbers_is_refused():
    for wrong in ('<origin xyz="1 2"/>', '<material><color rgba="1 0 0"/></material>'):
        visual = f'<visual>{wrong}<geometry><sphere radius="1"/></geometry></visual>'
        with pytest.raises(ValueError, match=r"must be . numbers"):
            read_shapes(f'<robot name="r"><link name="a">{visual}</link></robot>')
