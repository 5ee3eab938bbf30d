"""What a class declares: actions, also those of its base classes, and what a robot follows."""

import pytest

from ros_visualise.core.errors import UsageError
from ros_visualise.data import Image, Odometry, Twist
from ros_visualise.nodes import NoParams, action, find, node, source


class Counting:
    def __init__(self, params):
        self.count = 0

    def step(self, image, params):
        self.count += 1

    @action("count from zero again")
    def clear(self):
        self.count = 0

    @action("count one more")
    def add(self):
        self.count += 1


def test_actions_of_base_classes_count_and_the_nearest_one_tells_what_it_does():
    @node("frames", inputs={"image": Image}, outputs={})
    class Frames(Counting):
        @action("count two more")
        def add(self):
            self.count += 2

        def clear(self):
            self.count = 1

        @action("say it")
        def say(self):
            pass

    declared = Frames.declared
    assert declared.actions == {
        "add": "count two more",
        "say": "say it",
        "clear": "count from zero again",
    }
    made = declared.make(NoParams())
    for name in declared.actions:
        getattr(made, name)()
    assert made.count == 1


def test_robots_share_the_actions_that_all_of_them_have():
    shared = {"stop", "reset", "start_mission"}
    assert set(find("husky").actions) == shared
    assert set(find("quadrotor").actions) == shared | {"take_off", "land"}


def test_a_robot_follows_no_other_velocities_than_a_twist_has():
    with pytest.raises(
        UsageError, match=r"source boat: no velocity axis 'surge'; choose from linear\.x"
    ):
        source(
            "boat",
            params=NoParams,
            inputs={"cmd_vel": Twist},
            outputs={"odom": Odometry},
            velocity_axes=("surge",),
        )
