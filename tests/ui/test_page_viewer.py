"""The read-only address: who comes by it sees all and changes nothing."""

import logging

import pytest
from page_client import TOKEN, VIEW_TOKEN, Live, get
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

OURS = {"X-Ros-Visualise": "1"}


def test_a_viewer_sees_what_others_change(page, port, runtime):
    with (
        Live(port, "/live/nodes") as owner,
        Live(port, "/live/nodes", VIEW_TOKEN) as viewer,
    ):
        viewer.read_until(lambda: "filters" in viewer.values)
        assert (owner.state.get("readOnly"), viewer.state["readOnly"]) == (None, True)
        owner.set("filters", "threshold", 77)
        assert owner.state["readOnly"] is False
        viewer.read_until(lambda: viewer.values["filters"]["threshold"] == 77)


def test_a_viewer_asks_what_it_sees(page, port):
    assert get(port, "/?ask=graph", VIEW_TOKEN, **OURS)[0] == 200
    assert get(port, "/", VIEW_TOKEN)[0] == 200


@pytest.mark.parametrize("query", ["upload=a.mp4&size=1", "size=1&%75pload=a.mp4"])
def test_an_upload_of_a_viewer_is_refused(page, port, query):
    with pytest.raises(InvalidStatus) as refused:
        connect(f"ws://127.0.0.1:{port}/{VIEW_TOKEN}/?{query}")
    assert refused.value.response.status_code == 403


def test_a_viewer_never_learns_the_token(page, port):
    logging.getLogger("ros_visualise").warning("a line")
    with connect(f"ws://127.0.0.1:{port}/{VIEW_TOKEN}/live/monitor") as log:
        log.send('{"show": "log"}')
        assert TOKEN not in log.recv(timeout=60)
    assert TOKEN not in get(port, "/", VIEW_TOKEN)[2]
    for path in ("nodes", "robot", "files"):
        with Live(port, f"/live/{path}", VIEW_TOKEN) as viewer:
            viewer.read_until(lambda viewer=viewer: len(viewer.got) > 2 or viewer.state)
            assert TOKEN not in str(viewer.got)
