"""The read-only address: who comes by it sees all and changes nothing, whatever they send."""

import json
import logging
from contextlib import closing

import pytest
from page_client import CAMERA, TOKEN, VIEW_TOKEN, Client, get
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from ros_visualise.ui import ViewOptions
from ros_visualise.ui.page import Page

OURS = {"X-Ros-Visualise": "1"}
NAMED = {"Threshold", "● Record", "Save parameters", "Save layout", "FPS"}
"""Some of what can be changed."""
CHANNELS = {
    "address": "filters/threshold=3",
    "pick": "filters 0.5 0.5",
}


@pytest.fixture
def page(port, runtime, tmp_path):
    shown = Page(ViewOptions(port=port, record_dir=tmp_path))
    shown.open(runtime)
    yield shown
    shown.close()


@pytest.fixture
def owner(page, port):
    client = Client(port)
    with closing(client):
        client.read_until(lambda: client.images >= 3 and client.values.keys() >= NAMED)
        yield client


@pytest.fixture
def viewer(page, port):
    client = Client(port, f"/{VIEW_TOKEN}")
    with closing(client):
        client.read_until(lambda: client.images >= 3 and client.values.keys() >= NAMED)
        yield client


def everything(viewer):
    """A message of every kind that changes something, for each element."""
    for label, value in list(viewer.values.items()):
        uuid = viewer.uuid(label)
        other = CHANNELS.get(label, changed(value))
        yield {"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": other}}
        yield {"type": "GuiButtonHoldMessage", "uuid": uuid, "frequency": 10}
        yield {"type": "GuiRemoveMessage", "uuid": uuid}
    for uuid in viewer.commands:
        yield {"type": "CommandTriggerMessage", "uuid": uuid}
    yield {"type": "FileTransferStartUpload", "transfer_uuid": "x", "part_count": 1}
    yield {"type": "ShareUrlRequest"}
    yield {"type": "ResetSceneMessage"}


def changed(value):
    """Another value of the same type; a press of what is a button."""
    if isinstance(value, bool):
        return not value
    return value + 1 if isinstance(value, int | float) else "none"


def test_no_message_of_a_viewer_changes_anything(page, owner, viewer, runtime, tmp_path, port):
    before = dict(owner.values)
    params = {name: one.current for name, one in runtime.parameters.items()}
    state = runtime.playback.state
    for message in everything(viewer):
        viewer.send(message)
    owner.set("Threshold", 77)  # is done after all that
    owner.read_until(lambda: runtime.parameters["filters"].current.threshold == 77)
    later = Client(port)
    with closing(later):
        later.read_until(lambda: later.values.get("Threshold") == 77)
        later.read_until(lambda: later.values.keys() >= before.keys())
        assert later.values == before | {"Threshold": 77}
    assert runtime.playback.state == state
    after = {name: one.current for name, one in runtime.parameters.items()}
    assert {k: v for k, v in after.items() if k != "filters"} == {
        k: v for k, v in params.items() if k != "filters"
    }
    assert not list(tmp_path.iterdir())


def test_a_viewer_sees_what_others_change(owner, viewer, runtime):
    owner.set("Threshold", 77)
    viewer.read_until(lambda: viewer.values["Threshold"] == 77)
    seen = viewer.images
    runtime.playback.play()
    viewer.read_until(lambda: viewer.images > seen + 3)


def test_what_a_viewer_sent_is_said_once(owner, viewer, caplog):
    for _ in range(50):
        viewer.set("Threshold", 3)
    viewer.send(CAMERA)
    owner.read_until(lambda: any("this address is read-only" in html for html in owner.html))
    said = [one.getMessage() for one in caplog.records if "read-only" in one.getMessage()]
    assert said == ["page: change by a viewer rejected: this address is read-only"]


def test_a_viewer_asks_what_it_sees(page, port):
    assert get(port, "/?ask=graph", VIEW_TOKEN, **OURS)[0] == 200
    assert get(port, "/", VIEW_TOKEN)[0] == 200


def test_an_upload_of_a_viewer_is_refused(page, port):
    for query in ("upload=a.mp4&size=1", "size=1&%75pload=a.mp4"):
        with pytest.raises(InvalidStatus) as refused:
            Client(port, f"/{VIEW_TOKEN}", query=f"?{query}")
        assert refused.value.response.status_code == 403


def test_a_viewer_never_learns_the_token(page, owner, viewer, port):
    logging.getLogger("ros_visualise").warning("a line")
    with connect(f"ws://127.0.0.1:{port}/{VIEW_TOKEN}/live/monitor") as log:
        log.send('{"show": "log"}')
        assert TOKEN not in log.recv(timeout=60)
    assert TOKEN not in get(port, "/", VIEW_TOKEN)[2]
    assert TOKEN not in "".join(viewer.html)
    assert TOKEN not in json.dumps(viewer.values)
