"""Missions and their files."""

import math
from itertools import pairwise
from pathlib import Path

import pytest

from ros_visualise.core.errors import OpenError
from ros_visualise.simulation.missions import Mission, read_mission
from ros_visualise.simulation.route import Carrot, Route


def write(folder: Path, text: str) -> Path:
    path = folder / "mission.yaml"
    path.write_text(text)
    return path


def test_a_file_says_shape_size_height_speed_and_laps(tmp_path: Path):
    text = "shape: square\nsize: 6\nheight: 3.5\nspeed: 2\nlaps: 2\ncenter: [1, -1]\n"
    mission = read_mission(write(tmp_path, text))
    assert mission == Mission("square", (6, 6), (1, -1), height=3.5, speed=2, laps=2)
    route = mission.route()
    assert route.length_m == 24
    assert route.at(0) == (-2, -4, 3.5)
    assert route.at(9) == (4, -1, 3.5)
    assert route.at(25) == route.at(1)


def test_a_file_gives_way_points(tmp_path: Path):
    path = write(tmp_path, "waypoints:\n- [0, 0, 2]\n- [4, 0, 2, 90]\nspeed: 1.5\nland: false\n")
    mission = read_mission(path)
    assert not mission.land
    route = mission.route()
    assert route.length_m == 4
    assert route.yaw_at(1) == pytest.approx(math.pi / 2)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("shape: circle", "choose from square, figure_of_eight, lawn_mower"),
        ("shape: [1]", "give one of square, figure_of_eight, lawn_mower"),
        ("speed: 1", "give a shape (square, figure_of_eight, lawn_mower) or waypoints"),
        ("waypoints: []", "give a shape"),
        ("shape: square\nwaypoints: [[0, 0, 1]]", "omit one"),
        ("shape: square\nspeeed: 1", "no such key: 'speeed'; choose from shape, size, center"),
        ("shape: square\nspeed: fast", "speed cannot be 'fast': give a number"),
        ("shape: square\nspeed: .nan", "speed cannot be nan"),
        ("shape: square\nspeed: -1", "speed is -1.0: give a value from 0.01 to 100 m/s"),
        ("shape: square\nsize: 1e300", "from 0.1 to 1000 m"),
        ("shape: lawn_mower\nspacing: 1e-9", "from 0.1 to 1000 m"),
        ("shape: square\nlaps: 1.5", "laps cannot be 1.5: give a whole number"),
        (f"shape: square\nlaps: {10**30}", "from 0 to 1000000"),
        (f"shape: square\nspeed: {10**400}", "speed cannot be"),
        ("shape: square\nsize: [1, 2, 3]", "size cannot be [1, 2, 3]: give one or two numbers"),
        ("shape: square\nland: 1", "give true or false"),
        ("land_on: roof", "land_on cannot be 'roof': give pad, or omit it"),
        ("land_on: 3", "land_on cannot be 3: give pad"),
        ("waypoints: [[0, 0]]", "a waypoint is [x, y, z] or [x, y, z, yaw]"),
        ("waypoints: [[0, 0, -1]]", "not below the ground"),
        ("waypoints: [[1e9, 0, 1]]", "within 10000 m"),
        ("waypoints: 5", "waypoints cannot be 5: give a list"),
        ("- 1", "keys and values"),
        ("", "keys and values"),
        ("shape: [", "not YAML: "),
        ("a: 1\nb: c: d", "in line 2"),
        ("a: " + 500 * "[", "nested more than 50 deep in line 1"),
        ("\0", "not YAML: give a text file"),
    ],
)
def test_a_wrong_file_is_one_line(tmp_path: Path, text: str, complaint: str):
    with pytest.raises(OpenError) as caught:
        read_mission(write(tmp_path, text))
    assert complaint in str(caught.value)
    assert "mission.yaml" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_no_file_is_one_line(tmp_path: Path):
    with pytest.raises(OpenError, match=r"no such file.* one of square, figure_of_eight"):
        read_mission(tmp_path / "none.yaml")


def test_way_points_on_the_ground_are_flown_at_the_height():
    mission = Mission(waypoints=((1, 0, 0), (2, 0, 3)), height=1.5)
    assert mission.route().points == [(1, 0, 1.5), (2, 0, 3)]


def test_a_lawn_mower_covers_its_field_with_rows_no_further_apart_than_asked():
    points = Mission("lawn_mower", size=(10.0, 6.0), spacing=2.5).route().points
    levels = sorted({y for _, y, _ in points})
    assert levels[0] == -3
    assert levels[-1] == 3
    assert max(b - a for a, b in pairwise(levels)) <= 2.5
    assert {x for x, _, _ in points} == {-5, 5}


def test_an_eight_goes_through_its_middle_twice():
    route = Mission("figure_of_eight", size=(8.0, 4.0)).route()
    near = [p for p in route.points[:-1] if math.hypot(p[0], p[1]) < 1e-9]
    assert len(near) == 2
    assert max(x for x, _, _ in route.points) == pytest.approx(4)
    assert max(y for _, y, _ in route.points) == pytest.approx(2, rel=0.01)


def test_a_carrot_waits_for_who_follows_it():
    route = Route([(0, 0, 0), (10, 0, 0)])
    carrot = Carrot(route, lookahead_m=2.0)
    for _ in range(100):
        carrot.advance((0, 0, 0), 0.1)
    assert carrot.point == pytest.approx((2, 0, 0))
    while not carrot.at_end:
        carrot.advance(carrot.point, 0.1)
    assert carrot.point == (10, 0, 0)


def test_the_corners_of_a_way_are_where_it_turns_sharply():
    assert Mission("square", size=(2.0, 1.0)).route().corners == [0, 2, 3, 5]
    assert Mission("lawn_mower", size=(2.0, 1.0), spacing=1.0).route().corners == [2, 3]
    assert Mission("figure_of_eight").route().corners == []
    there_and_back = Route([(0, 0, 0), (3, 0, 0), (5, 0.2, 0), (3, 0, 0)])
    assert there_and_back.corners == pytest.approx([3 + math.hypot(2, 0.2)])
    closed_twice = Route([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 0, 0)], closed=True)
    assert closed_twice.corners == pytest.approx([0, 1, 2])
    assert Route([(1, 1, 0)]).corners == []


def test_a_carrot_waits_at_the_start_and_at_corners_until_its_follower_is_there():
    carrot = Carrot(Route([(0, 0, 0), (2, 0, 0), (2, 1, 0)]), lookahead_m=1.0, tolerance_m=0.1)
    for follower, point in [
        ((0, 0.2, 0), (0, 0, 0)),
        ((0, 0.1, 0), (1, 0, 0)),
        ((1.8, 0, 0), (2, 0, 0)),
        ((1.95, 0, 0), (2, 0.95, 0)),
    ]:
        for _ in range(100):
            carrot.advance(follower, 0.05)
        assert carrot.point == pytest.approx(point, abs=0.06)


def test_laps_are_gone_around_and_zero_has_no_end():
    square = Route([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], closed=True)
    assert square.length_m == 4
    twice, endless = Carrot(square, 9.0, laps=2), Carrot(square, 9.0, laps=0)
    for _ in range(90):
        twice.advance(twice.point, 0.1)
        endless.advance(endless.point, 0.1)
    assert twice.at_end
    assert not endless.at_end
    assert endless.way_m > 8


def test_a_small_way_is_not_gone_around_without_its_follower():
    carrot = Carrot(Mission("figure_of_eight", size=(1.0, 1.0)).route(), lookahead_m=5.0)
    for _ in range(1000):
        carrot.advance((0.0, 0.0, 4.0), 0.1)
    assert carrot.way_m < 0.5
