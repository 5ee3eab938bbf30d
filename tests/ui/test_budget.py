"""How much is on its way to browsers at once."""

from contextlib import ExitStack

import pytest

from ros_visualise.ui.server.answers import Refusal
from ros_visualise.ui.server.budget import Budget, Client, Share

ONE, OTHER = Client("192.0.2.1"), Client("192.0.2.2")
LOOKING = [Client(f"192.0.2.{number}", is_viewer=True) for number in range(9)]


@pytest.fixture
def budget():
    return Budget(each=Share(2, 100), viewers=Share(3, 150), of_all=Share(4, 200))


@pytest.fixture
def held():
    with ExitStack() as stack:
        yield stack


def refused(budget, client, size=0):
    try:
        with budget.answer(client) as hold:
            hold(size)
    except Refusal as refusal:
        return refusal.status == 503
    return False


def test_a_client_has_so_many_answers_at_once(budget, held):
    held.enter_context(budget.answer(ONE))
    with budget.answer(ONE):
        assert refused(budget, ONE)
        assert not refused(budget, OTHER)
    assert not refused(budget, ONE)


def test_a_client_has_so_many_bytes_at_once(budget, held):
    held.enter_context(budget.answer(ONE))(60)
    assert refused(budget, ONE, 41)
    assert not refused(budget, ONE, 40)
    assert not refused(budget, OTHER, 100)
    held.close()
    assert not refused(budget, ONE, 100)


def test_nothing_is_made_for_who_has_all_that_they_may(budget, held):
    held.enter_context(budget.answer(ONE))(100)
    with pytest.raises(Refusal, match="busy"), budget.answer(ONE):
        pytest.fail("it was let in")


def test_all_together_have_a_limit(budget, held):
    held.enter_context(budget.answer(ONE))(100)
    held.enter_context(budget.answer(OTHER))(70)
    third = Client("192.0.2.3")
    assert refused(budget, third, 31)
    assert not refused(budget, third, 30)


def test_who_only_looks_leaves_room_for_others(budget, held):
    for client in LOOKING[:3]:
        held.enter_context(budget.answer(client))(50)
    assert refused(budget, LOOKING[3])
    assert not refused(budget, ONE, 50)
    assert not refused(budget, Client(LOOKING[0].address), 50)


def test_what_is_larger_than_a_share_goes_alone(budget, held):
    held.enter_context(budget.answer(ONE))(1000)
    assert refused(budget, OTHER, 1)
    held.close()
    assert not refused(budget, OTHER, 1000)
    held.enter_context(budget.answer(ONE))(1)
    assert refused(budget, OTHER, 1000)


def test_what_failed_holds_nothing(budget):
    def fail():
        with budget.answer(ONE) as hold:
            hold(100)
            raise ZeroDivisionError

    for _ in range(9):
        with pytest.raises(ZeroDivisionError):
            fail()
    assert not refused(budget, ONE, 100)
