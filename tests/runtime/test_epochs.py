"""Jumps of time: found by stamps where nobody tells of them, once for all topics."""

import threading

import numpy as np
import pytest

from ros_visualise.data import Header, Image
from ros_visualise.runtime.ingress import Epochs, Ingress, Numbering
from ros_visualise.runtime.topics import Topic

S = 1_000_000_000
MS = 1_000_000


def epochs_of(messages, epochs=None):
    """The epochs of (topic, stamp in seconds, time of arrival in seconds)."""
    epochs = epochs or Epochs()
    return [
        epochs.of(topic, round(stamp_s * S), round(now_s * S)) for topic, stamp_s, now_s in messages
    ]


def test_time_jumps_where_stamps_go_back_by_more_than_a_second():
    stamps = [5, 6, 5.2, 7, 1, 2, 8, 9, 3]
    assert epochs_of(("a", stamp, 10 * n) for n, stamp in enumerate(stamps)) == [
        *(0, 0, 0, 0),
        *(1, 1, 1, 1),
        2,
    ]


def test_messages_without_a_stamp_are_no_jump():
    stamps = [5, 0, 5.1, 0, 0, 5.2, 1, 0, 1.1]
    assert epochs_of(("a", stamp, 10 * n) for n, stamp in enumerate(stamps)) == [
        *(0, 0, 0, 0, 0, 0),
        *(1, 1, 1),
    ]


def test_topics_that_jump_one_after_the_other_jump_once():
    messages = [
        *(("a", 30, 30), ("b", 30, 30), ("c", 29.9, 30)),
        *(("a", 0.05, 30.1), ("b", 30.1, 30.1), ("c", 0.1, 30.2), ("b", 0.2, 30.3)),
        *(("a", 1, 31.1), ("b", 1, 31.1), ("c", 1, 31.2)),
    ]
    assert epochs_of(messages) == [0, 0, 0, 1, 0, 1, 1, 1, 1, 1]


def test_a_topic_that_has_not_jumped_takes_part_again_after_a_second():
    messages = [("a", 30, 30), ("other clock", 500, 30), ("a", 0.05, 30.1)]
    later = [("other clock", 500.2, 30.2), ("other clock", 502, 32), ("other clock", 503, 33)]
    assert epochs_of(messages + later) == [0, 0, 1, 0, 1, 1]


@pytest.mark.parametrize("name", ["/tf_static", "/robot1/tf_static", "map"])
def test_topics_that_hold_for_all_times_tell_no_time(name):
    epochs = Epochs(timeless=("map",))
    assert epochs_of([(name, 100, 0), (name, 5, 1), ("a", 100, 2)], epochs) == [0, 0, 0]


def test_two_clocks_on_one_topic_are_noticed_and_not_listened_to():
    messages = [("both", stamp, n / 10) for n, stamp in enumerate([100, 50, 100.2, 50.2] * 5)]
    assert set(epochs_of(messages)[1:]) == {1}


@pytest.mark.parametrize("name", ["a", "/tf"])
def test_one_stamp_far_ahead_is_no_jump_and_a_later_jump_is(name):
    stamps = [5, 5.1, 4000, 5.2, 5.3, 4001, 5.4]
    epochs = Epochs()
    assert epochs_of([(name, stamp, stamp) for stamp in stamps], epochs) == [0] * 7
    later = [(name, 1 + n / 2, 6 + n / 2) for n in range(4)]
    assert epochs_of(later, epochs)[-1] == 1


def test_where_time_goes_on_from_far_ahead_it_may_jump_back():
    stamps = [5, 4000, 4000.1, 5.2]
    assert epochs_of(("a", stamp, stamp) for stamp in stamps) == [0, 0, 0, 1]


def test_old_transforms_among_others_are_no_jump_and_transforms_that_stay_old_are():
    """Their publishers disagree, and some send old ones once more."""
    old = [("/tf", 100 + n / 10 - 90 * (n % 3 == 2), n / 10) for n in range(28)]
    epochs = Epochs()
    assert epochs_of(old, epochs) == [0] * 28
    new = [("/tf", 10 + n / 10, 3 + n / 10) for n in range(20)]
    assert epochs_of(new, epochs) == [0] * 10 + [1] * 10


def test_a_jump_that_a_person_asked_for_is_one():
    epochs = Epochs()
    assert epochs_of([("a", 30, 30), ("b", 30, 30)], epochs) == [0, 0]
    epochs.begin()
    assert epochs_of([("a", 0, 31), ("b", 0, 31), ("a", 1, 32)], epochs) == [1, 1, 1]


def test_messages_from_several_threads_are_numbered_once_and_in_order():
    numbering, taken = Numbering(), []

    class Taker:
        def put(self, packet):
            taken.append(packet.number)

    ingresses = []
    for name in "ab":
        topic = Topic("/topic")
        topic.connect(Taker())
        ingresses.append(Ingress(name, topic, numbering))
    image = Image(np.zeros((1, 1), np.uint8), "mono8", Header(1))
    threads = [
        threading.Thread(target=lambda one=one: [one.publish(image) for _ in range(500)])
        for one in ingresses * 3
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(taken) == list(range(1, 3001))


def test_messages_of_one_topic_keep_their_order_whoever_sends_them():
    numbering, taken, topic = Numbering(), [], Topic("/topic")

    class Taker:
        def put(self, packet):
            taken.append(packet.number)

    topic.connect(Taker())
    ingress = Ingress("a", topic, numbering)
    image = Image(np.zeros((1, 1), np.uint8), "mono8", Header(1))
    threads = [
        threading.Thread(target=lambda: [ingress.publish(image) for _ in range(500)])
        for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert taken == list(range(1, 2001))
