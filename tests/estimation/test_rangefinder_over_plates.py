"""A rangefinder over a raised plate, such as a landing pad, is not wrong; one that is, is named."""

import numpy as np
import pytest
from driven import drive, params
from world import T0, Event, Pose, S, Tag, World, along, tags_on_ground

from ros_visualise.data import Header, Range

PAD = "tag36h11_99"
TAGS = tags_on_ground([(x, y, 0) for x in (-1, 1, 6, 8) for y in (-1, 1)], side=0.3)
PLATES = TAGS | {PAD: Tag(Pose(np.eye(3), np.array([4.0, 0, 0.4])), 0.4)}
OVER_PAD_S = 5.0, 9.5


def flown(tags, fault_m=lambda t: 0.0, **values):
    """A slow flight 3 m above a field with a pad, which takes 4 s to cross."""
    world = World(along((0, 0, 3), (9, 0, 3), speed=0.6), tags)
    random = np.random.default_rng(1)
    events = world.events(14)
    for t in np.arange(0.25, 14, 0.1):
        R, p = world.truth(t)
        top = 0.4 if abs(p[0] - 4) < 1.2 else 0.0
        distance = (p[2] - top) / (R.T @ [0, 0, 1])[2] + random.normal(0, 0.02) + fault_m(t)
        at = Header(round((t + T0) * S), "below")
        events.append(Event(t, 2, "rangefinder", Range(distance, 0.1, 40.0, header=at)))
    return drive(sorted(events, key=lambda one: one[:2]), params(**values), start=world.start())


@pytest.mark.parametrize("values", [{"moving": PAD}, {}], ids=["it may move", "of the map"])
def test_a_pad_below_is_no_contradiction(values):
    run = flown(PLATES, **values)
    assert not run.says("rangefinder has contradicted")
    assert run.counted("rangefinder unused") > 20
    assert run.counted("rangefinder used") > 60


def test_a_faulty_rangefinder_is_named_over_a_pad_too():
    run = flown(PLATES, lambda t: -0.9 if t > OVER_PAD_S[0] else 0.0, moving=PAD)
    assert run.says("rangefinder has contradicted the estimate")


def test_a_step_that_no_plate_explains_is_named():
    lower = {**TAGS, PAD: replace_height(PLATES[PAD], 0.0)}
    assert flown(lower, moving=PAD).says("rangefinder has contradicted the estimate")


def replace_height(tag, z):
    return Tag(Pose(tag.pose.R, np.array([*tag.pose.p[:2], z])), tag.side)
