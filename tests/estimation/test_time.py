"""Laws of time: a measurement counts at its own stamp, or it is dropped with a reason."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from driven import drive, params
from world import HERE, ORIGIN, T0, Sensor, World, along, map_text, square, surveyed, tags_on_ground

AT_ORIGIN = ", ".join(map(str, ORIGIN))
GRID = [(x, y, -5) for x in range(0, 13, 4) for y in range(0, 13, 4)]
TAGS = tags_on_ground(GRID)
NAMES = {"detections": "images"}  # of sensors in the world
WITH_GPS = params(gps_origin=AT_ORIGIN, gps_slow=0.5)
SENSORS = ("odometry", "detections", "imu", "gps")


def sensors(**changes):
    """All of them; the odometry begins, and later it comes last of those of one time."""
    later = [(0.01, np.inf)]
    several = {
        "images": Sensor(5, priority=-1, spans=later),
        "imu": Sensor(40, priority=-1, spans=later),
        "gps": Sensor(2, priority=-1, spans=later),
        "odometry": Sensor(10),
    }
    return {name: replace(one, **changes.get(name, {})) for name, one in several.items()}


def known_map(tmp_path, tags=TAGS, sigma_m=0.01, sigma_rad=0.01, **values):
    """Parameters with a surveyed map."""
    found, covariance = surveyed(tags, sigma_m, sigma_rad, 0)
    (tmp_path / "map.yaml").write_text(map_text(found, covariance))
    given = {"map": str(tmp_path / "map.yaml"), "mode": "frozen", "level_sigma": 0.2}
    return params(**given | values)


def test_fixes_later_than_the_newest_image_are_used():
    late = sensors(images={"latency_s": 0.08}, gps={"latency_s": 0.1})
    world = World(along(*square()), TAGS, **late)
    run = drive(world.events(15), WITH_GPS, start=HERE)
    assert run.counted("GPS.*used") >= 0.9 * 2 * 14


PRECISE = {"gps_sigma": 0.03, "gps_slow": 0.0}


@pytest.fixture(scope="module")
def precise_map(tmp_path_factory):
    folder = tmp_path_factory.mktemp("maps")
    return known_map(folder, gps_origin=AT_ORIGIN, gps_slow=0.0, delay=0.5)


@cache
def in_order(given, until):
    """The last pose where all arrives in the order of its stamps."""
    events = World(along(*square()), TAGS, **sensors(), **PRECISE).events(until)
    return drive(events, given, start=HERE).poses[-1]


@pytest.mark.parametrize("late", ["detections", "imu", "gps", "odometry", "all"])
def test_any_order_of_arrival_gives_the_same_result(late, precise_map):
    several = SENSORS if late == "all" else (late,)
    jitter = {NAMES.get(one, one): {"jitter_s": 0.3} for one in several}
    way, until = along(*square()), 8.0
    mixed = World(way, TAGS, **sensors(**jitter), **PRECISE).events(until)

    def key(one):
        stamp = one.message.header.stamp_ns / 1e9 - T0
        is_mixed = 1 < stamp < until - 1  # both ends come in time
        return (one.arrival_s if is_mixed else stamp), one.priority

    other = drive(sorted(mixed, key=key), precise_map, start=HERE)
    (t, here, P), (t2, there, P2) = in_order(precise_map, until), other.poses[-1]
    assert t == pytest.approx(t2)
    sigma = np.sqrt(np.diag(P)[:3])
    assert (abs(here.p - there.p) < 0.03 * sigma).all(), (here.p - there.p) / sigma
    np.testing.assert_allclose(np.diag(P2), np.diag(P), rtol=0.02)


@pytest.mark.parametrize("late", ["images", "gps", "imu"])
def test_older_ones_are_counted_with_the_reason(late):
    world = World(along(*square()), TAGS, **sensors(**{late: {"latency_s": 3.0}}))
    run = drive(world.events(10), params(gps_origin=AT_ORIGIN, delay=0.5), start=HERE)
    name = {"images": "image|camera|detection|late", "gps": "GPS|fix", "imu": "imu"}[late]
    dropped = {"images": 30, "gps": 10, "imu": 200}[late]
    assert run.counted(f"(?=.*({name}))(?=.*(late|old|drop))") >= dropped
    assert run.says(rf"({name}).*(late|delay|old)|(late|delay|old).*({name})")


@cache
def undisturbed():
    """The end of a flight whose stamps are all right, and the number of its landmarks."""
    run = drive(World(along(*square()), TAGS, **sensors()).events(8), WITH_GPS, start=HERE)
    return run.poses[-1], run.counts[-1][1]


@pytest.mark.parametrize("port", SENSORS)
@pytest.mark.parametrize("seconds", [5000.0, -30.0])
def test_one_wild_stamp_is_one_rejected_message(port, seconds):
    number = {"odometry": 40, "detections": 20, "imu": 160, "gps": 8}[port]
    wild = {NAMES.get(port, port): {"stamps_s": {number: seconds}}}
    run = drive(World(along(*square()), TAGS, **sensors(**wild)).events(8), WITH_GPS, start=HERE)
    (_, pose, P), landmarks = undisturbed()
    assert run.counts[-1][1] >= landmarks, "the map was dropped"
    inside = [one for one in run.poses if 0 <= one[0] <= 8]
    assert len(inside) >= 0.98 * len(run.odometries)
    assert len(run.poses) - len(inside) <= 1
    assert run.counted("loss") == 0
    sigma = np.sqrt(np.diag(run.poses[-1][2]))
    np.testing.assert_allclose(sigma, np.sqrt(np.diag(P)), rtol=0.1)
    assert np.linalg.norm((run.poses[-1][1].p - pose.p) / sigma[:3]) < 1
    assert run.says("stamp|future|past|clock|older")


@pytest.mark.parametrize("by", ["stamps", "reset"])
def test_the_built_map_is_kept_when_time_goes_back(by, tmp_path):
    path = tmp_path / "built.yaml"
    given = params(save_to=str(path))
    world = World(along(*square()), TAGS, **sensors())
    events = world.events(8)
    run = drive(events, given, start=HERE)
    built = set(run.landmarks)
    assert len(built) >= 3
    if by == "reset":
        run.node.reset()
    drive(events[:200], given, run=run, start=HERE)  # the recording begins again
    run.node.save_map(given)
    text = path.read_text() if path.exists() else ""
    kept = {name for name in built if f"name: {name}\n" in text}
    assert kept == built, f"{len(kept)} of {len(built)} landmarks"
    assert run.says(r"(time|stamp)[^\n]*(back|jump|reset)|(back|jump|reset)[^\n]*(time|stamp)")


@pytest.mark.parametrize("frame", ["imu_link", "gps_link"])
def test_sensors_are_used_whose_frames_come_later(frame):
    path, port = along(*square(40)), frame.removesuffix("_link")
    world = World(path, **{port: Sensor(20 if port == "imu" else 2, priority=-1)})
    late, none = (drive(world.events(12), WITH_GPS, tf_s=s, start=HERE) for s in (3.0, 1e9))
    early = drive(world.events(12), WITH_GPS, start=HERE)
    last = [run.poses[-1][2] for run in (late, none, early)]
    assert not np.allclose(last[2], last[1], rtol=1e-3), "it has no effect even at once"
    assert not np.allclose(last[0], last[1], rtol=1e-3)


def test_clocks_that_differ_are_named(tmp_path):
    """The camera's is 80 ms ahead of the odometry's."""
    ahead = sensors(images={"clock_s": 0.08, "latency_s": 0.1})
    ahead["imu"] = ahead["gps"] = None
    world = World(along(*square(), speed=4.0), TAGS, **ahead)
    run = drive(world.events(30), known_map(tmp_path))
    assert run.says("clock|timing|time offset|synchroni[sz]")


def test_late_images_are_named(tmp_path):
    late = sensors(images={"latency_s": 2.0})
    late["imu"] = late["gps"] = None
    world = World(along(*square()), TAGS, **late)
    run = drive(world.events(15), known_map(tmp_path))
    assert re.search("delay|late", run.sentence(5, 15)), run.sentence(5, 15)
