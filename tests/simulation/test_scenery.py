"""What stands in a simulated world, as markers."""

from dataclasses import replace

import numpy as np
import pytest
from simulated_runs import BLIND_QUADROTOR, collect

from ros_visualise.data import MarkerArray, MarkerType
from ros_visualise.geometry import se3
from ros_visualise.messages import from_message, to_message
from ros_visualise.messages.definitions import Definitions
from ros_visualise.simulation.frames import prefixed
from ros_visualise.simulation.landmarks import tag_bits
from ros_visualise.simulation.pad import PadMotion
from ros_visualise.simulation.robots.husky.settings import HuskyParams
from ros_visualise.simulation.simulator import Simulation


@pytest.fixture(scope="module")
def simulation():
    return Simulation("husky", "playpen", settings=HuskyParams(camera_width=32, camera_height=24))


@pytest.fixture(scope="module")
def markers(simulation):
    messages = {one.name: one.message for one in first(simulation, 3)}
    return messages["scenery"].markers


def first(simulation, count):
    run = simulation.run()
    return [next(run) for _ in range(count)]


def placed(marker):
    """Its cells (N, 3) in the map."""
    T = se3.from_pose(marker.position_xyz, marker.quat_xyzw)
    return se3.apply(T, marker.points_xyz)


def test_a_tag_has_its_cells_where_they_are(simulation, markers):
    sheets = [one for one in markers if len(one.points_xyz) == 100]
    for landmark in simulation.world.landmarks:
        near = [np.linalg.norm(one.position_xyz - landmark.position_xyz) for one in sheets]
        sheet = sheets[int(np.argmin(near))]
        white = sheet.colors_rgba[:, :3].mean(axis=1).reshape(10, 10) > 0.5
        assert (white[1:-1, 1:-1] == tag_bits(landmark.tag_id)).all()
        cells = placed(sheet).reshape(10, 10, 3)
        corners = [cells[y, x] for y, x in ((1, 1), (1, 8), (8, 8), (8, 1))]
        inside = landmark.position_xyz + 7 / 8 * (landmark.corners() - landmark.position_xyz)
        assert np.allclose(corners, inside, atol=2e-3)


def test_all_is_in_the_map_for_ever_and_nothing_moves(markers):
    assert {one.header.frame_id for one in markers} == {"map"}
    assert {one.header.stamp_ns for one in markers} == {0}
    assert len({one.id for one in markers}) == len(markers)


def test_solids_have_their_sizes(markers):
    pillars = [one for one in markers if one.type == MarkerType.CYLINDER]
    assert any(np.allclose(one.scale_xyz, [0.4, 0.4, 2.5]) for one in pillars)
    (ground,) = [one for one in markers if np.allclose(one.scale_xyz[:2], 48)]
    assert ground.position_xyz[2] + ground.scale_xyz[2] / 2 < 0


def test_it_travels_as_ros_messages(simulation, markers):
    _, _, output = first(simulation, 3)
    read = from_message(to_message(output.message, Definitions("cdr").types), type(output.message))
    assert len(read.markers) == len(markers)


def test_who_goes_on_later_gets_it_too(simulation):
    names = [one.name for one in first(simulation, 3)]
    assert names == ["robot_description", "tf_static", "scenery"]


def test_a_pad_that_moves_is_drawn_in_its_own_frame_which_tf_tells():
    settings = replace(BLIND_QUADROTOR, pad=True, pad_motion=PadMotion.LINE, pad_reach=20.0)
    simulation = Simulation("quadrotor", "plane", settings=settings)
    found = collect(simulation, 4.0)
    deck = [one for one in found["scenery"][0].markers if one.header.frame_id == "pad_deck"]
    assert len(deck) == 6  # deck, cart, helipad, three tags
    told = [one for tf in found["tf"] for one in tf.transforms if one.child_frame_id == "pad_deck"]
    places = np.array([one.translation_xyz for one in told])
    truth = np.array([one.position_xyz for one in found["pad"]])
    assert np.array_equal(places, truth)
    assert places[-1, 0] - places[0, 0] > 2.0
    moved = prefixed(MarkerArray(tuple(deck)), "uav1")
    assert {one.header.frame_id for one in moved.markers} == {"uav1/pad_deck"}


def test_a_pad_without_tags_has_the_helipad_alone():
    settings = replace(BLIND_QUADROTOR, pad=True, pad_tags=False)
    simulation = Simulation("quadrotor", "plane", settings=settings)
    (scenery,) = [one.message for one in first(simulation, 3) if one.name == "scenery"]
    markers = scenery.markers
    assert sum(one.header.frame_id == "pad_deck" for one in markers) == 3
