"""PageFiles that come and go through the page: uploads, downloads, and what is opened next."""

import http.client
import re
from contextlib import closing, suppress
from io import BytesIO
from pathlib import Path
from zipfile import ZipFile

import pytest
from page_client import TOKEN, VIEW_TOKEN, Client
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
    client = Client(port)
    client.read_until(lambda: "Source" in client.values)
    with closing(client):
        yield client


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
    assert chooser.take() == tmp_path / "there/a.mp4"
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
        ("empty.mp4", 0, "give a file of 1 byte to 8 GiB"),
        ("large.mp4", (8 << 30) + 1, "give a file of 1 byte to 8 GiB"),
        ("short.mp4", 2, "size differs from the declared one"),
    ],
)
def test_uploads_that_are_refused(client, port, tmp_path, name, size, said):
    (tmp_path / "there/old.mp4").write_text("precious")
    upload(port, [b"1234"], upload=name, size=size, open="")
    client.read_until(lambda: any(said in html for html in client.html))
    assert [path.name for path in (tmp_path / "there").iterdir()] == ["old.mp4"]
    assert (tmp_path / "there/old.mp4").read_text() == "precious"
    assert not (tmp_path / "away.mp4").exists()


def test_a_browser_that_goes_leaves_nothing(client, port, tmp_path):
    with connect(f"ws://127.0.0.1:{port}/{TOKEN}/?upload=a.mp4&size=9") as socket:
        socket.send(b"1234")
        wait_for(lambda: list((tmp_path / "there").glob("a.mp4.*.part")))
    client.read_until(lambda: any("connection closed" in html for html in client.html))
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
    client.set("/image_raw", False)
    client.set("/controlled_stream", False)
    client.set("File", "mine.mcap")
    client.set("● Record", True)
    client.read_until(lambda: any("mine.mcap: " in html for html in client.html))
    client.set("● Record", True)
    client.read_until(lambda: any('data-download="mine.mcap"' in html for html in client.html))
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
    client.set("File", "mine.mcap")
    client.set("Split", "64K")
    client.set("● Record", True)
    runtime.playback.play()
    said = re.compile(r"/mine_0\.mcap: \d+ messages in \d+ files, ")
    client.read_until(lambda: any(map(said.search, client.html)))
    client.set("● Record", True)
    client.read_until(lambda: any('data-download="mine_0.mcap"' in html for html in client.html))
    files = {path.name: path.read_bytes() for path in (tmp_path / "there").iterdir()}
    assert set(files) == {f"mine_{number}.mcap" for number in range(len(files))}
    assert len(files) > 1
    offered = next(html for html in reversed(client.html) if "data-download" in html)
    own = {"X-Ros-Visualise": "1"}
    for name, content in files.items():
        assert f'data-download="{name}"' in offered
        assert fetch(port, f"ask=recorded&name={name}&from=0", **own) == (200, content)
        with AnyReader([tmp_path / "there" / name]) as reader:
            assert "/edges" in reader.topics


def test_a_recorded_folder_is_downloaded_as_one_file(client, port, tmp_path):
    client.set("File", "mine")
    client.set("● Record", True)
    client.read_until(lambda: any("mine: " in html for html in client.html))
    client.set("● Record", True)
    client.read_until(lambda: any('data-download="mine.zip"' in html for html in client.html))
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


def test_no_topic_is_recorded_where_none_is_chosen(client, tmp_path):
    client.set("Select", "None")
    client.set("● Record", True)
    client.read_until(
        lambda: any("choose at least one topic to record" in html for html in client.html)
    )
    assert not list((tmp_path / "there").iterdir())


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
        assert chooser.take() == tmp_path / "z.mp4"
    with pytest.raises(UsageError, match="cannot be opened"):
        chooser.ask(tmp_path.parent / "z.mp4")
