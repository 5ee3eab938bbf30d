"""Every parameter that is changed in flight takes effect, or is declared as one for a restart.

The same messages are given to three navigators: one that keeps a parameter, one that has another
value from the start, and one that is given that value in flight. Where the second differs from the
first, the third must differ too.
"""

import hashlib
from copy import deepcopy
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from driven import drive, params
from world import (
    HERE,
    ORIGIN,
    T0,
    Event,
    S,
    Sensor,
    World,
    along,
    map_text,
    square,
    tags_on_ground,
)

from ros_visualise.core.params import Spec, specs, update
from ros_visualise.data import (
    FluidPressure,
    Header,
    MagneticField,
    Range,
    TwistWithCovarianceStamped,
)

AT_ORIGIN = ", ".join(map(str, ORIGIN))
CHANGED_S, END_S = 2.5, 6.0
SPECS = {spec.name: spec for spec in specs(type(params()))}
VALUES = {
    "class_prefix": "tag36h11_",
    "object_prefix": "thing_",
    "moving": "tag36h11_10, object_7",
    "gps_origin": "49.0, 8.4, 103.0",
    "delay": 0.05,
    "max_speed": 5.0,
    "ground_height": -4.5,
    "min_sightings": 40,
    "min_parallax": 3.0,
    "level_sigma": 5.0,
    "corner_floor": 2.0,
    "start": "1, 2, 0, 30",
}
"""Other values than a switched, multiplied or next one, by name."""

STARTED = {"start": "0, 0, 0, 0"}


def other(spec: Spec):
    """Another valid value."""
    if spec.name in VALUES:
        return VALUES[spec.name]
    if spec.choices:
        return next(one for one in spec.choices if one != str(spec.default.value))
    if spec.type is bool:
        return not spec.default
    return type(spec.default)(spec.clamp(spec.default * 4 if spec.default else 0.05))


TAGS = tags_on_ground([(x, y, -5) for x in range(1, 13, 3) for y in (0, 4, 8)])


def base(**values):
    return params(**{"gps_origin": AT_ORIGIN, "ground_height": -5.0} | values)


@cache
def events():
    """A flight with all sensors and late images, over tags, one of them a mere number, and posts.

    Its odometry jumps while the IMU pauses.
    """
    world = World(
        along(*square(), speed=4.0),
        {("7" if name.endswith("_9") else name): tag for name, tag in TAGS.items()},
        odometry=Sensor(8),
        images=Sensor(4, latency_s=0.2, priority=-1),
        imu=Sensor(20, priority=-1, spans=[(0, 3.5), (4.5, 99)]),
        gps=Sensor(2, priority=-1),
        barometer=Sensor(3, priority=-1),
        magnetometer=Sensor(3, priority=-1),
        posts=[(x, y, -5) for x in range(1, 14, 3) for y in (-1, 1.5, 4)],
        gps_states=False,
        slides=[(4, 4.1, (0, 1.0, 0))],
    )
    several = [part for event in world.events(END_S) for part in objects_apart(event)]
    return sorted([*several, *others(world)], key=lambda one: (one.arrival_s, one.priority))


@cache
def parted():
    """The events before and from the change on."""
    before = [event for event in events() if event.arrival_s < CHANGED_S]
    return before, events()[len(before) :]


@cache
def until_changed():
    """A run up to the change, by default."""
    return drive(parted()[0], base(), start=HERE)


def others(world):
    """Sensors in the robot's middle, without noise: pressure, field, range, velocities."""
    for t in np.arange(0.5, END_S, 0.25):
        R, p = world.path(t)
        body = R.T @ (world.path(t + 0.01).p - world.path(t - 0.01).p) / 0.02
        stamp = round((t + T0) * S)
        at, below = Header(stamp, "base_link"), Header(stamp, "below")
        height = ORIGIN[2] + p[2]
        pressure = 101325 * (1 - 0.0065 * height / 288.15) ** 5.25588
        ahead = np.diag([1e-3, 1e-3, 1e6, 1e6, 1e6, 1e6])
        messages = {
            "barometer": FluidPressure(pressure, 0.0, at),
            "magnetometer": MagneticField(R.T @ [0, 2e-5, -4e-5], header=at),
            "rangefinder": Range((p[2] + 5) / (R.T @ [0, 0, 1])[2], 0.1, 50.0, header=below),
            "optical_flow": TwistWithCovarianceStamped(1.01 * body, np.zeros(3), ahead, at),
            "wheel_speed": TwistWithCovarianceStamped(0.99 * body, np.zeros(3), ahead, at),
        }
        for name, message in messages.items():
            yield Event(t, -1, name, message)


def objects_apart(event):
    """Posts come in messages of their own, as from a network on ROS 1."""
    if event.port != "detections":
        return [event]
    several = event.message.detections
    tags = tuple(one for one in several if one.class_id != "post")
    posts = tuple(
        replace(one, hypotheses=(replace(one.hypotheses[0], class_id="7"),))
        for one in several
        if one.class_id == "post"
    )
    return [
        event._replace(message=replace(event.message, detections=tags)),
        event._replace(port="objects", message=replace(event.message, detections=posts)),
    ]


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    written = tmp_path_factory.mktemp("maps") / "map.yaml"
    written.write_text(map_text(TAGS, np.eye(6) * 1e-4))
    return str(written)


PIECES = 6
"""Of the flight after the change; most parameters take effect in the first."""


def flown(first, then=None):
    """Digests of what is published after the change: until the end of each piece of the flight."""
    before, after = parted()
    if then and first == base():
        run = deepcopy(until_changed())
    else:
        run = drive(before, first, start=HERE)
    run.params = then or first
    for piece in np.array_split(np.arange(len(after)), PIECES):
        drive(after[piece[0] : piece[-1] + 1], run.params, run=run, start=HERE)
        text = [repr(one) for one in run.poses if one[0] > CHANGED_S + 0.3]
        text += [repr(sorted(run.landmarks)), repr(run.states[-1][1].values)]
        text += [repr(one.hypotheses[0]) for one in run.landmarks.values()]
        yield hashlib.sha256("".join(text).encode()).hexdigest()


def differ(one, other):
    """Whether two flights publish different things; they end where they do."""
    return any(a != b for a, b in zip(one, other, strict=True))


@cache
def by_default():
    return tuple(flown(base()))


@pytest.mark.parametrize("name", [name for name, spec in SPECS.items() if not spec.file("x")])
def test_a_parameter_changed_in_flight_takes_effect(name, path):
    needs = {"mode": {"map": path}, "start_sigma": STARTED, "start_yaw_sigma": STARTED}
    spec, before = SPECS[name], base(**needs.get(name, {}))
    kept = tuple(flown(before)) if name in needs else by_default()
    changed = update(before, {name: other(spec)})
    if not spec.restart and differ(flown(before, changed), kept):
        return
    assert differ(flown(changed), kept), f"{name} has no effect at all in this flight: extend it"
    assert spec.restart, f"{name}={getattr(changed, name)} changes nothing in flight"


def test_the_deviations_of_an_empty_start_change_nothing_in_flight():
    changed = base(start_sigma=2.0, start_yaw_sigma=90.0)
    assert not differ(flown(base(), changed), by_default())


def test_another_map_takes_effect_in_flight(path):
    assert differ(flown(base(), base(map=path, mode="extend")), by_default())


def test_the_map_is_saved_where_it_is_set_in_flight(tmp_path):
    first, then = (base(save_to=str(tmp_path / name)) for name in ("a.yaml", "b.yaml"))
    run = drive(events(), first, [(CHANGED_S, then)])
    run.node.save_map(then)
    assert [one.name for one in tmp_path.iterdir()] == ["b.yaml"]
