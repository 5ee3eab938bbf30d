"""Landing on a pad by sight: decisions of the lander, and a whole landing."""

import math
from dataclasses import replace

import numpy as np
import pytest
from simulated_runs import BLIND_QUADROTOR, collect

from ros_visualise.core.errors import OpenError, UsageError
from ros_visualise.data import Header, Odometry
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.geometry.rotations import from_rpy
from ros_visualise.graph.landmarks import tags_of_world
from ros_visualise.nodes.landing_target import LandingTarget, LandingTargetParams
from ros_visualise.nodes.tag_detector import TagDetector, TagParams
from ros_visualise.simulation.missions import Mission
from ros_visualise.simulation.pad import PadMotion
from ros_visualise.simulation.robots.quadrotor.lander import Lander
from ros_visualise.simulation.robots.quadrotor.settings import QuadrotorParams
from ros_visualise.simulation.simulator import Simulation

S = 1_000_000_000


def own(time_s, *place, yaw=0.0):
    return Odometry(
        np.array(place, float), from_rpy([0, 0, yaw]), header=Header(round(time_s * S), "odom")
    )


def target(time_s, *place, velocity=(0, 0, 0), sigma=0.01):
    return Odometry(
        np.array(place, float),
        from_rpy([0, 0, 0]),
        np.array(velocity, float),
        pose_covariance=sigma**2 * np.eye(6),
        header=Header(round(time_s * S), "odom"),
    )


def guided(seen, robot, yaw=0.0):
    lander = Lander(5.0)
    lander.see(seen)
    return lander, lander.guide(robot, yaw)


def test_right_above_what_it_sees_it_goes_down_and_slower_the_lower_it_is():
    climbs = [guided(target(1, 0, 0, 0), own(1, 0, 0, z))[1].velocity[2] for z in (6, 3, 1, 0.5)]
    assert climbs == sorted(climbs)
    assert -1.3 < climbs[0] < climbs[-1] < -0.1


def test_too_far_aside_it_goes_there_first():
    lander, guidance = guided(target(1, 1.0, 0.5, 0), own(1, 0, 0, 2))
    assert guidance.aside == pytest.approx((1.0, 0.5))
    assert guidance.velocity == pytest.approx((0, 0, 0))
    assert not lander.touches_down


def test_it_moves_as_the_target_does_and_knows_where_that_is_now():
    _, guidance = guided(target(1, 0, 0, 0, velocity=(1, 0, 0)), own(1.2, 0, 0, 5))
    assert guidance.aside == pytest.approx((0.2, 0))
    assert guidance.velocity[:2] == pytest.approx((1, 0))


def test_axes_of_the_odometry_that_has_turned_are_turned_back():
    _, guidance = guided(target(1, 1, 0, 0, velocity=(1, 0, 0)), own(1, 0, 0, 5), math.pi / 2)
    assert guidance.aside == pytest.approx((0, 1))
    assert guidance.velocity[:2] == pytest.approx((0, 1))
    assert guidance.yaw == pytest.approx(math.pi / 2)


@pytest.mark.parametrize("seen", [target(0.5, 0, 0, 0), target(1, 0, 0, 0, sigma=2.0)])
def test_what_is_old_or_not_sure_sends_it_up_again_to_where_it_began(seen):
    assert guided(seen, own(1, 0, 0, 2))[1].velocity[2] > 0
    assert guided(seen, own(1, 0, 0, 6))[1].velocity[2] == 0


def test_of_what_it_has_not_seen_for_long_it_knows_nothing():
    lander, guidance = guided(target(1, 0, 0, 0), own(9, 0, 0, 2))
    assert guidance is None
    assert not lander.has_seen


def test_just_above_it_goes_down_to_the_ground_though_it_sees_nothing_more():
    lander, _ = guided(target(1, 0, 0, 0), own(1, 0, 0, 0.25))
    assert lander.touches_down
    assert lander.guide(own(1.8, 0, 0, 0.2), 0.0).velocity[2] < 0


def fly(settings: QuadrotorParams, seed: int, blind_from_s=math.inf, longest_s=30.0):
    """A landing by rendered images; how far off in metres, and heights by time."""
    mission = Mission(waypoints=((0, 1.4, 2.5),), land_on="pad", height=2.5, speed=2.0)
    simulation = Simulation(
        *("quadrotor", "plane", seed, mission, settings),
        wants=lambda output: output != "image" or simulation.time_ns < blind_from_s * 1e9,
    )
    tags, params = TagParams(tags=tags_of_world("plane"), corner_floor=0.0), LandingTargetParams()
    detector, node, frames = TagDetector(tags), LandingTarget(params), FrameTree()
    last, heights = {}, []
    for stamp_ns, name, message in simulation.run():
        answer, last[name] = None, message
        if name in ("tf", "tf_static"):
            frames.add(message, static=name == "tf_static")
        elif name == "odom":
            answer = node.step(params, odom=message, frames=frames)
        elif name == "image":
            answer = node.step(params, detector.step(message, tags)["detections"], frames=frames)
        elif name == "truth":
            heights.append(message.position_xyz[2])
        if answer:
            simulation.see(answer["landing_target_odom"])
        if name == "pad" and (simulation.finished or stamp_ns > longest_s * 1e9):
            break
    apart = last["truth"].position_xyz - last["pad"].position_xyz
    return simulation, math.hypot(*apart[:2]), np.array(heights)


SMALL = replace(
    QuadrotorParams(),
    camera_width=320,
    camera_height=240,
    camera_rate=5.0,
    gps=False,
    pad_x=0.0,
    pad_y=1.9,
)


@pytest.mark.usefixtures("opengl")
def test_it_lands_on_a_pad_that_moves_in_wind():
    moving = replace(SMALL, wind=4.0, pad_motion=PadMotion.LINE, pad_reach=30.0, pad_x=-5.0)
    simulation, off_m, heights = fly(moving, 3)
    assert simulation.finished
    assert not simulation.failure
    assert off_m < 0.15
    assert heights[-1] == pytest.approx(0.46, abs=0.02)


@pytest.mark.usefixtures("opengl")
def test_it_climbs_again_where_it_sees_the_pad_no_more():
    simulation, _, heights = fly(SMALL, 0, blind_from_s=7.0, longest_s=12.0)
    assert not simulation.finished
    assert heights[350:].min() < 2.0
    assert heights[-1] > 2.4


def test_a_mission_that_lands_on_a_pad_brings_it_along():
    simulation = Simulation("quadrotor", "plane", 0, Mission(land_on="pad"), BLIND_QUADROTOR)
    assert simulation.pad is not None
    assert simulation.lands_visually
    assert collect(simulation, 6)["truth"][-1].position_xyz[2] > 3


def test_without_a_pad_there_is_none_to_land_on():
    simulation = Simulation("quadrotor", "plane", 0, None, BLIND_QUADROTOR)
    with pytest.raises(UsageError, match="set pad=true"):
        simulation.add_mission(Mission(land_on="pad"))
    with pytest.raises(OpenError, match="use the quadrotor"):
        Simulation("husky", "plane", 0, Mission(land_on="pad"))
