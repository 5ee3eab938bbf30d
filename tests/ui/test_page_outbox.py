"""What comes and goes on a page leaves nothing there, whoever looks."""

import pytest
from page_client import Client
from waiting import wait_for

ROUNDS, LABELS = 50, 20
FEW = 300  # messages; each round brings and takes more than 40


def kept(server):
    """How many messages a page keeps for browsers that come."""
    return len(server._websock_server._broadcast_buffer.message_from_id)


@pytest.fixture
def inspector(port, server):
    client = Client(port)
    yield client
    client.close()


def test_what_is_sent_to_a_browser_that_has_just_left_is_no_failure(server, port):
    """A handle of it may be in use when it leaves; the suite makes warnings errors."""
    client = Client(port)
    client.read_until(server.get_clients)
    (there,) = server.get_clients().values()
    client.close()
    wait_for(lambda: not server.get_clients(), "the browser to leave")
    there.camera.look_at = (1.0, 2.0, 3.0)


def test_elements_that_come_and_go_leave_nothing(server, inspector):
    for number in range(ROUNDS):
        for _ in range(LABELS):
            server.gui.add_checkbox("for a moment", True).remove()
        last = server.gui.add_checkbox(f"round {number}", True)
        inspector.read_until(lambda number=number: f"round {number}" in inspector.values)
        last.remove()
    assert "for a moment" not in inspector.values
    assert kept(server) < FEW
