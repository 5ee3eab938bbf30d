"""Laws of GPS: nothing is refused for ever, fixes count at their own time, whatever comes first."""

import numpy as np
import pytest
from driven import FALSE, drive, params
from seeds import runs
from world import ORIGIN, Sensor, World, along, square

AT_ORIGIN = ", ".join(map(str, ORIGIN))
SETTLED_S = 5.0  # in which an estimate that turned out wrong must be seen to be


def fixed(**values):
    """Parameters for the receiver of this world."""
    return params(**{"gps_origin": AT_ORIGIN, "gps_slow": 0.5, "level_sigma": 0.1} | values)


def judged(run, world, from_s, until_s, largest_m):
    """It is never falsely certain for long, and at the end it is right and uses its fixes."""
    share = run.falsely_certain(world, from_s + SETTLED_S, until_s)
    assert share < 0.02, f"falsely certain {share:.0%}, {run.off(world).max():.1f} m off"
    at_end = until_s - 20
    assert run.located(at_end) > 0.9
    assert run.off(world, at_end).max() < largest_m


@pytest.mark.parametrize("degrees", [0, 90, 180])
def test_a_map_whose_axis_points_east_is_found_by_a_robot_of_any_heading(degrees):
    path = along(*square(80, laps=1, turned=np.radians(degrees)))
    world = World(path, gps=Sensor(1, priority=-1), odometry=Sensor(5), images=Sensor(0.01))
    run = drive(world.events(90), fixed())
    judged(run, world, 40, 90, 5.0)


@pytest.mark.parametrize("way", [(20, 0, 0), (0, -20, 0), (0, 0, 12)])
def test_odometry_that_slides_is_corrected_by_fixes(way):
    world = World(
        along(*square(60)),
        gps=Sensor(1, priority=-1),
        odometry=Sensor(10),
        images=Sensor(0.01),
        slides=[(20, 21, way)],
    )
    run = drive(world.events(60), fixed())
    judged(run, world, 21, 60, 5.0)


def test_fixes_count_at_their_own_time_on_a_moving_robot():
    """By a precise receiver off the robot's middle, between odometries."""
    several = []
    for seed in range(runs(4, of=6)):
        world = World(
            along(*square(24, laps=6), speed=8.0),  # always in a bend
            seed=seed,
            gps=Sensor(3.7, priority=-1),
            imu=Sensor(50, priority=-1),
            odometry=Sensor(5),
            images=Sensor(0.01),
            gps_sigma=0.02,
            gps_slow=0.0,
        )
        run = drive(world.events(14), fixed(gps_slow=0.0, accel_density=3e-3))
        several.append(run.nees(world, 5).mean())
    mean = float(np.mean(several))
    assert 1.5 < mean < 4.5, f"NEES {mean:.1f} of 3"


@pytest.mark.parametrize("priority", [-1, 1])
def test_a_fix_may_come_before_or_after_the_odometry_of_its_time(priority):
    world = World(along(*square(60)), gps=Sensor(1, priority=priority), images=Sensor(10))
    run = drive(world.events(40), fixed())
    sigma = np.sqrt(np.trace(run.poses[-1][2][:3, :3]))
    alone = drive(world.events(40), fixed(gps=False))
    assert sigma < 0.7 * np.sqrt(np.trace(alone.poses[-1][2][:3, :3]))
    assert run.nees(world, 10).mean() < FALSE / 3
