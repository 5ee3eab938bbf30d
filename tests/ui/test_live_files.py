"""PageFiles that come and go through the page: uploads, downloads, and what is opened next."""

import http.client
import re
from contextlib import closing, suppress
from io import BytesIO
from pathlib import Path
from zipfile import ZipFile

import pytest
from page_client import TOKEN, VIEW_TOKEN, Live
from rosbags.highlevel import AnyReader
from waiting import wait_for
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from ros_visualise.core.errors import UsageError
from ros_visualise.ui import ViewOptions
from ros_visualise.ui.file_chooser import FileChooser
from ros_visualise.ui.page import Page

VIDEO = bytes(range(256)) * 600


@pytest.fixture
def chooser(tmp_path):
    (tmp_path / "here").mkdir()
    (tmp_path / "there").mkdir()
    return FileChooser(tmp_path / "here", tmp_path / "there")


@pytest.fixture
def page(port, runtime, chooser, tmp_path):
    shown = Page(ViewOptions(port=port, record_dir=tmp_path / "there", chooser=chooser))
    shown.open(runtime)
    yield shown
    shown.close()


@pytest.fixture
def client(page, port):
    with Live(port, "/live/files") as client:
        client.read_until(lambda: client.state.get("topics"))
        yield client


@pytest.fixture
def notices(page, port):
    with Live(port, "/live/nodes") as notices:
        yield notices


def upload(port, pieces, origin=None, token=TOKEN, **values):
    """Send a file; returns as soon as the server has ended it."""
    query = "&".join(f"{name}={value}" for name, value in values.items())
    with connect(f"ws://127.0.0.1:{port}/{token}/?{query}", origin=origin) as socket:
        with suppress(ConnectionClosed):
            for piece in pieces:
                socket.send(piece)
        with pytest.raises(ConnectionClosed):
            socket.recv(timeout=60)


def fetch(port, query, **headers):
    asking = http.client.HTTPConnection("127.0.0.1", port)
    with closing(asking):
        asking.request("GET", f"/{TOKEN}/?{query}", headers=headers)
        answer = asking.getresponse()
        return answer.status, answer.read()


def test_an_upload_is_whole_and_is_opened_when_all_are_there(page, port, chooser, tmp_path):
    pieces = [VIDEO[:60_000], VIDEO[60_000:120_000], VIDEO[120_000:]]
    upload(port, [b"12:00"], upload="a.SRT", size=5, open="")
    assert chooser.take() is None
    upload(port, pieces, upload="a.mp4", size=len(VIDEO), open="a.mp4")
    assert (tmp_path / "there/a.mp4").read_bytes() == VIDEO
    assert (tmp_path / "there/a.SRT").read_bytes() == b"12:00"
    assert chooser.take().what == tmp_path / "there/a.mp4"
    assert chooser.take() is None


@pytest.mark.parametrize(
    ("name", "size", "said"),
    [
        ("..%2Faway.mp4", 4, "give a plain name"),
        ("%2Ftmp%2Faway.mp4", 4, "give a plain name"),
        (".hidden.mp4", 4, "give a plain name"),
        ("a%00.mp4", 4, "contains control characters"),
        ("a%E2%80%AE4pm.mp4", 4, "contains invisible characters"),
        ("virus.py", 4, "give a file that ends in one of"),
        ("folder", 4, "give a file that ends in one of"),
        ("old.mp4", 4, "exists"),
        ("empty.mp4", 0, "the file must be between 1 byte and 8 GiB in size"),
        ("large.mp4", (8 << 30) + 1, "the file must be between 1 byte and 8 GiB in size"),
        ("short.mp4", 2, "size differs from the declared one"),
    ],
)
def test_uploads_that_are_refused(notices, port, tmp_path, name, size, said):
    (tmp_path / "there/old.mp4").write_text("precious")
    upload(port, [b"1234"], upload=name, size=size, open="")
    notices.read_until(lambda: notices.said(said))
    assert [path.name for path in (tmp_path / "there").iterdir()] == ["old.mp4"]
    assert (tmp_path / "there/old.mp4").read_text() == "precious"
    assert not (tmp_path / "away.mp4").exists()


def test_a_browser_that_goes_leaves_nothing(notices, client, port, tmp_path):
    with connect(f"ws://127.0.0.1:{port}/{TOKEN}/?upload=a.mp4&size=9") as socket:
        socket.send(b"1234")
        wait_for(lambda: list((tmp_path / "there").glob("a.mp4.*.part")))
        client.read_until(lambda: client.state["uploads"] == "a.mp4: 44 %")
    notices.read_until(lambda: notices.said("connection closed"))
    assert not list((tmp_path / "there").iterdir())


def test_who_may_only_look_uploads_nothing(page, port, tmp_path):
    with pytest.raises(InvalidStatus) as refused:
        upload(port, [b"1234"], token=VIEW_TOKEN, upload="a.mp4", size=4, open="")
    assert refused.value.response.status_code == 403
    assert not list((tmp_path / "there").iterdir())


def test_other_sites_upload_nothing(page, port, tmp_path):
    with pytest.raises(InvalidStatus):
        upload(port, [b"1234"], "http://evil.example", upload="a.mp4", size=4, open="")
    assert not list((tmp_path / "there").iterdir())


def test_only_what_was_recorded_is_downloaded_and_only_what_was_chosen_is_recorded(
    client, port, tmp_path
):
    (tmp_path / "there/other.mcap").write_text("secret")
    client.send("record", name="mine.mcap", topics=["/processed_image", "/edges"])
    client.read_until(lambda: "mine.mcap: " in client.state["text"])
    client.send("stop")
    client.read_until(lambda: client.state["links"] == ["mine.mcap"])
    own = {"X-Ros-Visualise": "1"}
    status, first = fetch(port, "ask=recorded&name=mine.mcap&from=0", **own)
    assert status == 200
    assert first == (tmp_path / "there/mine.mcap").read_bytes()
    assert fetch(port, "ask=recorded&name=mine.mcap&from=9", **own)[1] == first[9:]
    assert fetch(port, "ask=recorded&name=mine.mcap&from=0")[0] == 403
    for name in ("other.mcap", "../there/mine.mcap", ""):
        assert fetch(port, f"ask=recorded&name={name}", **own)[0] == 404
    with AnyReader([tmp_path / "there/mine.mcap"]) as reader:
        recorded = {one.topic for one in reader.connections}
    assert recorded == {"/processed_image", "/edges", "/parameter_events"}


def test_a_split_recording_is_downloaded_file_by_file(client, port, runtime, tmp_path):
    client.send("record", name="mine.mcap", split="64K")
    runtime.playback.play()
    said = re.compile(r"/mine_0\.mcap: \d+ messages in \d+ files, ")
    client.read_until(lambda: said.search(client.state["text"]))
    client.send("stop")
    client.read_until(lambda: "mine_0.mcap" in client.state["links"])
    files = {path.name: path.read_bytes() for path in (tmp_path / "there").iterdir()}
    assert set(files) == {f"mine_{number}.mcap" for number in range(len(files))}
    assert len(files) > 1
    own = {"X-Ros-Visualise": "1"}
    for name, content in files.items():
        assert name in client.state["links"]
        assert fetch(port, f"ask=recorded&name={name}&from=0", **own) == (200, content)
        with AnyReader([tmp_path / "there" / name]) as reader:
            assert "/edges" in reader.topics


def test_a_recorded_folder_is_downloaded_as_one_file(client, port, tmp_path):
    client.send("record", name="mine")
    client.read_until(lambda: "mine: " in client.state["text"])
    client.send("stop")
    client.read_until(lambda: client.state["links"] == ["mine.zip"])
    own = {"X-Ros-Visualise": "1"}
    status, whole = fetch(port, "ask=recorded&name=mine.zip&from=0", **own)
    assert status == 200
    for start in (1, 40, len(whole) // 2, len(whole) - 1):  # in headers, and in files
        assert fetch(port, f"ask=recorded&name=mine.zip&from={start}", **own)[1] == whole[start:]
    with ZipFile(BytesIO(whole)) as zipped:
        assert zipped.testzip() is None
        zipped.extractall(tmp_path / "unpacked")
    files = [path for path in (tmp_path / "there/mine").rglob("*") if path.is_file()]
    assert len(files) == len(zipped.namelist()) > 1
    for path in files:
        same = tmp_path / "unpacked" / path.relative_to(tmp_path / "there")
        assert same.read_bytes() == path.read_bytes()
    with AnyReader([tmp_path / "unpacked/mine"]) as reader:
        assert "/edges" in {one.topic for one in reader.connections}


def test_no_topic_is_recorded_where_none_is_chosen(client, notices, tmp_path):
    client.send("record", topics=[])
    notices.read_until(lambda: notices.said("choose at least one topic to record"))
    client.send("record", topics=["/no/such"])
    notices.read_until(lambda: notices.said("/no/such"))
    assert not list((tmp_path / "there").iterdir())


HOSTILE = [
    "",
    "[]",
    '{"do": "open"}',
    '{"do": "open", "name": 3}',
    '{"do": "record", "name": "../../x.mcap"}',
    '{"do": "record", "name": "x.mcap", "topics": "all"}',
    '{"do": "record", "split": "-1G"}',
    '{"do": "save", "what": "all", "name": "x.yaml"}',
    '{"do": "save", "what": "layout", "name": "../x.yaml"}',
    '{"do": "save", "what": "layout", "name": "x.yaml", "layout": "' + "x" * 30_000 + '"}',
    '{"do": "open", "name": "../secret.bag"}',
    '{"do": "open", "name": "/etc/passwd"}',
    '{"do": "open", "name": "a\\u0000b"}',
    '{"do": "open", "name": "file:///etc/passwd"}',
    '{"do": "open", "name": "lavfi:movie=/etc/passwd"}',
    '{"do": "open", "name": "concat:http://a|file:/etc/passwd"}',
    '{"do": "open", "name": "/dev/sda"}',
    '{"do": "open", "name": "rtsp://"}',
]


def test_hostile_messages_open_and_write_nothing(client, chooser, tmp_path, caplog):
    for text in HOSTILE:
        client.socket.send(text)
    client.send("save", what="layout", name="fine.yaml", layout='{"panel": "nodes"}')
    client.read_until(lambda: "fine.yaml" in client.state.get("saved", ""))
    assert [path.name for path in (tmp_path / "there").iterdir()] == ["fine.yaml"]
    assert chooser.take() is None
    assert not [record for record in caplog.records if record.exc_info]


def test_a_viewer_opens_records_and_saves_nothing(page, client, port, chooser, tmp_path):
    (tmp_path / "here/a.bag").touch()
    with Live(port, "/live/files", VIEW_TOKEN) as viewer:
        viewer.read_until(lambda: viewer.state.get("files") == ["a.bag"])
        viewer.send("open", name="a.bag")
        viewer.send("record", name="r.mcap")
        viewer.send("save", what="parameters", name="p.yaml")
        viewer.send("save", what="layout", name="l.yaml")
        client.send("save", what="layout", name="fine.yaml")
        viewer.read_until(lambda: "fine.yaml" in viewer.state.get("saved", ""))
    assert [path.name for path in (tmp_path / "there").iterdir()] == ["fine.yaml"]
    assert chooser.take() is None


def test_what_was_opened_is_offered_again(client, chooser, tmp_path):
    for name in ("a.bag", "b.bag"):
        (tmp_path / "here" / name).touch()
    client.read_until(lambda: client.state["files"] == ["a.bag", "b.bag"])
    for name in ("a.bag", "b.bag", str(tmp_path / "here/a.bag")):
        client.send("open", name=name)
    here = f"{tmp_path}/here"
    client.read_until(lambda: client.state["recent"] == [f"{here}/a.bag", f"{here}/b.bag"])
    assert chooser.take().what == tmp_path / "here/a.bag"
    for name in ("rtsp://me:secret@camera/stream", "/dev/video0"):
        client.send("open", name=name)
        wait_for(lambda name=name: chooser.take() == (name, False))
    client.read_until(lambda: client.state["recent"][0] == "/dev/video0")
    assert "secret" not in str(client.got)


def test_what_can_be_opened(chooser, tmp_path):
    for name in ("here/a.bag", "here/b.MP4", "here/notes.txt", "there/a.bag", "here/.c.bag"):
        (tmp_path / name).touch()
    (tmp_path / "here/ros2").mkdir()
    (tmp_path / "here/ros2/metadata.yaml").touch()
    (tmp_path / "here/empty").mkdir()
    assert [*chooser.files()] == ["a.bag", "b.MP4", "ros2", f"{tmp_path}/there/a.bag"]
    with pytest.raises(UsageError, match="cannot be opened"):
        chooser.ask(tmp_path / "here/notes.txt")
    assert chooser.take() is None


def test_what_is_there_is_opened_however_it_is_called_and_among_many(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for number in range(600):
        (tmp_path / f"{number:03}.mp4").touch()
    chooser = FileChooser(tmp_path, Path())  # as where FILE is given with its folder
    for path in (Path("z.mp4"), tmp_path / "z.mp4", Path(f"../{tmp_path.name}/z.mp4")):
        with pytest.raises(UsageError, match="cannot be opened"):
            chooser.ask(path)
    (tmp_path / "z.mp4").touch()
    for path in (Path("z.mp4"), tmp_path / "z.mp4", Path(f"../{tmp_path.name}/z.mp4")):
        chooser.ask(path)
        assert chooser.take().what == tmp_path / "z.mp4"
    with pytest.raises(UsageError, match="cannot be opened"):
        chooser.ask(tmp_path.parent / "z.mp4")
