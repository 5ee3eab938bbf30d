"""Which messages of several inputs come together."""

import random

import pytest

from ros_visualise.core.synchronizer import Approximate, Each, Exact, Latest, synchronizer


def joined(join, messages, ports=("image", "boxes"), ends=True, nbytes=0):
    """The sets as stamps by input, in the order of the ports, and what was dropped."""
    work = synchronizer(join, ports)
    sets = [s for port, stamp in messages for s in work.put(port, stamp, stamp, nbytes)]
    sets += work.finish() if ends else []
    return [tuple(one[port] for port in ports if port in one) for one in sets], dict(work.dropped)


def in_some_order(streams, seed):
    """All messages, those of each input in order."""
    rest = {port: list(stamps) for port, stamps in streams.items()}
    choose = random.Random(seed)
    while any(rest.values()):
        port = choose.choice([port for port, stamps in rest.items() if stamps])
        yield port, rest[port].pop(0)


def test_each_message_comes_by_itself():
    assert joined(Each(), [("image", 3), ("boxes", 3)]) == ([(3,), (3,)], {})


def test_exact_joins_equal_stamps_and_counts_what_has_no_partner():
    messages = [("image", 1), ("image", 2), ("boxes", 2), ("boxes", 3), ("image", 4), ("boxes", 5)]
    assert joined(Exact(), messages) == (
        [(2, 2)],
        {("image", "unmatched"): 2, ("boxes", "unmatched"): 2},
    )


def test_exact_does_not_wait_for_more_once_a_set_is_whole():
    assert joined(Exact(), [("boxes", 1), ("image", 1)], ends=False)[0] == [(1, 1)]


def test_what_others_have_passed_is_let_go_of_at_once():
    messages = [*(("image", stamp) for stamp in range(9)), ("boxes", 8)]
    assert joined(Exact(), messages, ends=False) == ([(8, 8)], {("image", "unmatched"): 8})


def test_messages_without_stamps_come_together_in_their_order():
    messages = [("image", 0), ("image", 0), ("boxes", 0), ("boxes", 0)]
    assert joined(Exact(), messages)[0] == [(0, 0), (0, 0)]


def test_approx_takes_the_nearest_and_not_the_first_within_the_slop():
    slop = Approximate(100e-9)
    messages = [("image", 50), ("image", 90), ("boxes", 100), ("image", 104), ("image", 150)]
    assert joined(slop, messages)[0] == [(104, 100)]
    assert joined(slop, messages[:3], ends=False)[0] == []  # a nearer one may still come
    assert joined(slop, messages[:3])[0] == [(90, 100)]


def test_approx_of_three_is_never_further_apart_than_the_slop():
    ports, slop_ns, choose = ("a", "b", "c"), 30, random.Random(5)
    streams = {port: sorted(choose.sample(range(3000), 60)) for port in ports}
    sets, dropped = joined(Approximate(slop_ns * 1e-9), in_some_order(streams, 1), ports)
    assert len(sets) > 10
    assert max(max(stamps) - min(stamps) for stamps in sets) <= slop_ns
    for place, port in enumerate(ports):
        used = [stamps[place] for stamps in sets]
        assert used == sorted(set(used))
        assert dropped[port, "unmatched"] == 60 - len(sets)


@pytest.mark.parametrize("join", [Exact(), Approximate(0), Approximate(20e-9), Approximate(1e-6)])
def test_sets_do_not_depend_on_which_input_is_ahead(join):
    choose = random.Random(7)
    streams = {port: sorted(choose.sample(range(400), 60)) for port in ("image", "boxes", "tags")}
    found = {repr(joined(join, in_some_order(streams, seed), tuple(streams))) for seed in range(30)}
    assert len(found) == 1


def test_a_message_that_comes_late_is_put_in_its_place():
    messages = [("image", 3), ("image", 2), ("boxes", 2), ("boxes", 3)]
    assert joined(Exact(), messages)[0] == [(2, 2), (3, 3)]


def test_so_many_wait_and_no_more():
    messages = [*(("image", stamp) for stamp in range(1000)), ("boxes", 999)]
    sets, dropped = joined(Exact(), messages)
    assert sets == [(999, 999)]
    assert dropped == {("image", "too many unmatched"): 900, ("image", "unmatched"): 99}


def test_so_many_bytes_wait_and_no_more():
    messages = [("image", stamp) for stamp in range(10)]
    _, dropped = joined(Exact(), messages, ends=False, nbytes=100 * 2**20)
    assert dropped == {("image", "too many unmatched"): 8}


def test_after_a_jump_nothing_from_before_it_is_joined():
    work = synchronizer(Exact(), ("image", "boxes"))
    work.put("image", 5, "before")
    work.reset(1)
    work.put("image", 1, "one")
    assert work.put("boxes", 5, "five") == []
    assert work.put("image", 5, "after") == [{"image": "after", "boxes": "five"}]
    assert work.dropped == {("image", "stale"): 1, ("image", "unmatched"): 1}


def test_latest_waits_for_the_first_of_the_others_and_then_takes_the_newest():
    messages = [
        *(("image", 1), ("map", 0), ("image", 2), ("image", 3)),
        *(("map", 4), ("map", 2), ("image", 5)),
    ]
    assert joined(Latest("image"), messages, ("image", "map")) == (
        [(2, 0), (3, 0), (5, 4)],
        {("image", "unmatched"): 1, ("map", "late"): 1},
    )


def test_after_a_jump_the_latest_is_what_is_older_than_the_new_time():
    work = synchronizer(Latest("image"), ("image", "map", "pose"))
    work.put("map", 0, "map")
    work.put("pose", 9, "pose of later")
    work.reset(3)
    assert work.put("image", 3, "image") == []
    work.put("pose", 3, "pose")
    assert work.put("image", 4, "image") == [{"image": "image", "map": "map", "pose": "pose"}]


@pytest.mark.parametrize("slop_s", [-1, float("nan"), float("inf"), "0.1", None])
def test_a_slop_is_a_time_that_is_no_less_than_nothing(slop_s):
    with pytest.raises(ValueError, match=r"Approximate\(.*\): give 0 or more seconds"):
        Approximate(slop_s)
