"""What a node or a source gives that is no message costs that message: said, counted, status 1."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hub import Hub, HubTransport
from waiting import wait_for

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.data import (
    Header,
    Image,
    Marker,
    MarkerArray,
    PoseStamped,
    Text,
    Transforms,
    TransformStamped,
)
from ros_visualise.graph import Graph, SourceNode, place
from ros_visualise.messages.recorded import TopicType
from ros_visualise.nodes import NoParams, node, source
from ros_visualise.runtime.bridge.outputs import StaticFrames, StaticTransformsOutput
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.runtime.queues import Packet
from ros_visualise.runtime.report import RecordingReport, RunReport
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.playback import Playback

COUNT = 12
BAD = (4, 7)
ORIGIN, UNTURNED = np.zeros(3), np.array([0.0, 0, 0, 1])


def image(number: int) -> Image:
    return Image(np.full((2, 3), number, np.uint8), "mono8", Header(10**9 * (number + 1), "camera"))


@source("numbers", params=NoParams, outputs={"image": Image})
class Numbers:
    def __init__(self, params: Any, playback: Any) -> None:
        self.given: Any = map(image, range(COUNT))

    def messages(self) -> Iterator[tuple[str, Any]]:
        return (("image", one) for one in self.given)

    def close(self) -> None:
        pass


def run(made: Any, target: Path | None, given: type = Numbers) -> tuple[LocalRuntime, RunReport]:
    """All of the source's images through a node of one input."""
    start = SourceNode("numbers", given.declared, NoParams(), {}, {"image": "/image"})  # type: ignore[attr-defined]
    outputs = {name: f"/{name}" for name in made.declared.outputs}
    graph = Graph(start, (place(made.declared, {"image": "/image"}, outputs),))
    runtime = LocalRuntime(graph, Playback(rate=0))
    if target is not None:
        runtime.start_recording(target)
    runtime.start()
    assert runtime.wait(20)
    runtime.stop()
    return runtime, runtime.report()


def read(path: Path) -> dict[str, list[int]]:
    """Topic -> seconds of its messages."""
    recording = open_recording(path)
    found: dict[str, list[int]] = {}
    for entry in recording.read():
        found.setdefault(entry.topic, []).append(entry.stamp_ns // 10**9)
    recording.close()
    return found


@pytest.mark.parametrize("name", ["r.mcap", "r.bag", "folder"])
def test_a_recording_goes_on_without_what_it_cannot_hold(
    name: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    @node("talker", inputs={"image": Image}, outputs={"text": Text, "markers": MarkerArray})
    def talker(image: Image, params: Any) -> dict[str, Any]:
        is_bad = image.pixels[0, 0] in BAD
        marker = Marker(0, id=2**40 if is_bad else 1, header=image.header)
        text = Text(int(image.pixels[0, 0]) if is_bad else "fine", image.header)
        return {"text": text, "markers": MarkerArray((marker,))}

    runtime, report = run(talker, tmp_path / name)
    recorded = report.recordings[str(tmp_path / name)]
    assert recorded == RecordingReport(3 * COUNT - 2 * len(BAD), 2 * len(BAD), 2 * len(BAD))
    assert report.is_incomplete
    [recording] = runtime._recordings
    assert recording.error is None
    good = [number + 1 for number in range(COUNT) if number not in BAD]
    found = read(tmp_path / name)
    assert (found["/text"], found["/markers"]) == (good, good)
    assert len(found["/image"]) == COUNT
    end = "(further occurrences suppressed)"
    text, markers = sorted(caplog.messages, key=lambda said: "/markers" in said)
    assert text.endswith(
        f"{name}: /text: message rejected: std_msgs/msg/String.data: 4 is not a valid string {end}"
    )
    assert "/markers: message rejected" in markers


class Uncertain(Image):
    """An image whose calibration cannot be had."""

    @property
    def camera_info(self) -> Any:
        raise RuntimeError("not calibrated yet")

    @camera_info.setter
    def camera_info(self, given: Any) -> None:
        pass


def test_a_recording_goes_on_where_a_calibration_cannot_be_had(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    @node("unsure", inputs={"image": Image}, outputs={"copy": Image})
    def unsure(image: Image, params: Any) -> Image:
        if image.pixels[0, 0] not in BAD:
            return image
        bad = Uncertain.__new__(Uncertain)
        vars(bad).update(vars(image))
        return bad

    runtime, report = run(unsure, tmp_path / "r.mcap")
    assert report.recordings[str(tmp_path / "r.mcap")].refused == len(BAD)
    assert len(read(tmp_path / "r.mcap")["/copy"]) == COUNT
    [said] = caplog.messages
    assert "/copy: message rejected: not a calibration: not calibrated yet" in said
    assert [one.error for one in runtime._recordings] == [None]


WRONG_HEADERS = {
    "no header": (None, "None is not a valid header"),
    "a number": (7, "7 is not a valid header"),
    "a text for a stamp": (Header("now"), "'now' is not a valid stamp"),
    "half a nanosecond": (Header(0.5), "0.5 is not a valid stamp"),
    "a stamp past all": (Header(2**70), "1180591620717411303424 is not a valid stamp"),
}


@pytest.mark.parametrize(("header", "why"), WRONG_HEADERS.values(), ids=WRONG_HEADERS)
def test_a_node_outlives_a_message_without_a_header(
    header: Any, why: str, caplog: pytest.LogCaptureFixture
) -> None:
    @node("poser", inputs={"image": Image}, outputs={"pose": PoseStamped, "copy": Image})
    def poser(image: Image, params: Any) -> dict[str, Any]:
        is_bad = image.pixels[0, 0] in BAD
        pose = PoseStamped(ORIGIN, UNTURNED, header if is_bad else image.header)
        return {"pose": pose, "copy": image}

    runtime, report = run(poser, None)
    assert report.topics["/pose"].messages == COUNT - len(BAD)
    assert report.topics["/copy"].messages == COUNT
    assert report.nodes["poser"].dropped == {"error": len(BAD)}
    assert runtime.failed
    [said] = caplog.messages
    assert why in said


def test_markers_that_are_none_cost_their_message_alone(caplog: pytest.LogCaptureFixture) -> None:
    @node("marker", inputs={"image": Image}, outputs={"markers": MarkerArray})
    def marker(image: Image, params: Any) -> Any:
        return MarkerArray((7,) if image.pixels[0, 0] in BAD else (Marker(0),))  # type: ignore[arg-type]

    runtime, report = run(marker, None)
    assert report.topics["/markers"].messages == COUNT - len(BAD)
    assert runtime.failed


def test_a_source_goes_on_after_what_is_no_message(caplog: pytest.LogCaptureFixture) -> None:
    @source("broken", params=NoParams, outputs={"image": Image})
    class Broken(Numbers):
        def messages(self) -> Iterator[tuple[str, Any]]:
            yield "image", 7
            yield "elsewhere", image(0)
            for number in range(COUNT):
                yield "image", image(number)
                yield "image", Image(image(number).data, "mono8", None)  # type: ignore[arg-type]

    @node("same", inputs={"image": Image}, outputs={"copy": Image})
    def same(image: Image, params: Any) -> Image:
        return image

    runtime, report = run(same, None, Broken)
    assert report.topics["/copy"].messages == COUNT
    assert report.nodes["numbers"].dropped == {"error": COUNT + 2}
    assert runtime.failed
    assert len(caplog.messages) == 3


def test_negative_stamps_cost_those_messages_alone_and_no_parameters(tmp_path: Path) -> None:
    @node("early", inputs={"image": Image}, outputs={"text": Text})
    def early(image: Image, params: Any) -> Text:
        return Text("early", image.header)

    @source("early", params=NoParams, outputs={"image": Image})
    class Early(Numbers):
        def __init__(self, params: Any, playback: Any) -> None:
            self.given = (
                Image(image(n).data, "mono8", Header((n - 4) * 10**9, "camera"))
                for n in range(COUNT)
            )

    _, report = run(early, tmp_path / "r.mcap", Early)
    assert report.recordings[str(tmp_path / "r.mcap")] == RecordingReport(2 * 8, 2 * 4, 2 * 4)
    found = read(tmp_path / "r.mcap")
    assert found["/image"] == found["/text"] == list(range(8))
    assert found["/parameter_events"] == [0, 0]


TALKER = """
from ros_visualise.data import Image, Marker
from ros_visualise.nodes import node

@node("talker", inputs={"image": Image}, outputs={"marker": Marker})
def talker(image, params):
    return Marker(0, id=2**40 if image.pixels[0, 0] == 4 else 1, header=image.header)
"""


def test_a_node_of_a_graph_goes_on_and_ends_with_status_1(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "talker.py").write_text(TALKER)
    hub, heard = Hub(), []
    peer = HubTransport(hub, name="peer")
    with hub.running("node", f"{tmp_path}/talker.py:talker", ends_with=1):
        images = peer.advertise("/image", TopicType(Image.type_name))
        wait_for(lambda: images.connections, "the node")
        peer.subscribe("/talker", Marker, heard.append, lambda _: None)
        images.publish(image(4))
        wait_for(lambda: "message rejected" in caplog.text, "a word about it")
        images.publish(image(5))
        wait_for(lambda: heard, "the next message")
    assert heard[0].header.stamp_ns == 6 * 10**9


class Choosy:
    """A publisher that cannot send frames of one name."""

    name, dropped, connections = "/tf_static", 0, 1

    def __init__(self) -> None:
        self.sent: list[list[str]] = []

    def publish(self, message: Any) -> None:
        names = [one.child_frame_id for one in message.transforms]
        if "bad" in names:
            raise DamagedMessage("bad is bad")
        self.sent.append(names)


def test_a_static_frame_that_cannot_be_sent_does_not_stay_among_the_others() -> None:
    publisher = Choosy()
    output = StaticTransformsOutput(publisher, StaticFrames())  # type: ignore[arg-type]
    for name in ("camera", "bad", "lidar"):
        frame = TransformStamped(name, ORIGIN, UNTURNED, Header(1, "base"))
        output.put(Packet(0, Transforms((frame,)), 0))
    assert publisher.sent == [["camera"], ["camera", "lidar"]]
    assert output.refused == 1
