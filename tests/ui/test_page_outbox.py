"""What comes and goes on a page leaves nothing there, whoever looks."""

import pytest
from page_client import Client
from waiting import wait_for

from ros_visualise.data import Marker, MarkerAction, MarkerArray, MarkerType

ROUNDS, LABELS = 50, 20
FEW = 300  # messages; each round brings and takes more than 40


def kept(server):
    """How many messages a page keeps for browsers that come."""
    return len(server._websock_server._broadcast_buffer.message_from_id)


def labels(number):
    """Texts that are all others than those of any other round."""
    texts = [f"{number}.{one}" for one in range(LABELS)]
    markers = [
        Marker(MarkerType.TEXT_VIEW_FACING, text=text, id=one) for one, text in enumerate(texts)
    ]
    return MarkerArray((Marker(MarkerType.CUBE, action=MarkerAction.DELETEALL), *markers))


def change(scene, rounds):
    for number in rounds:
        scene.show("/labels", labels(number))
        scene.refresh()


def texts(client):
    return {node["text"] for node in client.nodes.values() if "text" in node}


@pytest.fixture
def inspector(port, server):
    client = Client(port)
    yield client
    client.close()


def test_labels_that_come_and_go_leave_nothing_before_a_browser_comes(server, scene, port):
    change(scene, range(ROUNDS))
    assert kept(server) < FEW
    client = Client(port)
    newest = {f"{ROUNDS - 1}.{one}" for one in range(LABELS)}
    client.read_until(lambda: texts(client) == newest)
    client.close()


def test_labels_that_come_and_go_leave_nothing_while_a_browser_looks(server, scene, inspector):
    for number in range(ROUNDS):
        change(scene, [number])
        there = {f"{number}.{one}" for one in range(LABELS)}
        inspector.read_until(lambda there=there: texts(inspector) == there)
    assert kept(server) < FEW


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
