"""What every runtime has in common; whoever imports this gives a fixture ``playing``.

    from contract import *

It is a `Running` for each runtime: the image pipeline that plays ``video`` over and over.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_videos import numbered, write_video
from mcap.reader import make_reader
from waiting import wait_for

from ros_visualise.core.errors import ParameterError, UsageError
from ros_visualise.data import Image
from ros_visualise.nodes import find
from ros_visualise.runtime.base import Runtime
from ros_visualise.sinks.parts import Split

TOPICS = {"/image_raw", "/controlled_stream", "/processed_image", "/edges"}
NODES = {"streamer", "fps_control", "filters", "edge_detector"}
FRAMES = 30  # at 25 fps: fps_control lets all of them pass


@dataclass
class Running:
    """A runtime that plays a video of known images over and over."""

    runtime: Runtime
    images: list[np.ndarray]
    prefix: str = ""  # of its nodes' names

    def parameters(self, node: str) -> Any:
        return self.runtime.parameters[self.prefix + node]

    def take(self, topic: str, count: int) -> list[Image]:
        """The next so many images of a topic."""
        subscription = self.runtime.subscribe(topic)
        try:
            return [wait_for(lambda: subscription.take(1), topic) for _ in range(count)]
        finally:
            subscription.close()


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_video(tmp_path_factory.mktemp("video") / "v.mkv", numbered(FRAMES, 160, 120))


def wait_for_pipeline(runtime: Runtime, prefix: str = "") -> None:
    """Wait until all of the image pipeline can be seen."""
    wait_for(lambda: set(runtime.graph.topics) >= TOPICS, "all topics")
    wait_for(lambda: all(known(runtime, prefix + node) for node in NODES), "all nodes")


def known(runtime: Runtime, node: str) -> bool:
    """Whether a node has told of its parameters."""
    return node in runtime.parameters and bool(vars(runtime.parameters[node].current))


@pytest.fixture
def running(playing: Running) -> Iterator[Running]:
    """It starts each test with the parameters that it started with."""
    before = {name: vars(of.current) for name, of in playing.runtime.parameters.items()}
    yield playing
    for name, values in before.items():
        now = playing.runtime.parameters[name]
        changed = {n: value for n, value in values.items() if getattr(now.current, n) != value}
        now.update(changed)  # others may be read-only


def key(image: Image | np.ndarray) -> bytes:
    pixels = image.pixels if isinstance(image, Image) else image
    return np.ascontiguousarray(pixels).tobytes()


def expected(images: list[np.ndarray], topic: str) -> dict[bytes, int]:
    """What the nodes' own functions make of the images -> the number of the image."""
    filters, edges = find("filters"), find("edge_detector")
    results = {}
    for number, pixels in enumerate(images):
        image = Image(pixels, "bgr8")
        if topic in ("/processed_image", "/edges"):
            image = filters.make(None).step(image=image, params=filters.params())
        if topic == "/edges":
            image = edges.make(None).step(image=image, params=edges.params())["edges"]
        results[key(image)] = number
    return results


@pytest.mark.parametrize("topic", sorted(TOPICS))
def test_every_topic_has_the_pixels_that_the_nodes_make(running: Running, topic: str):
    wanted = expected(running.images, topic)
    received = running.take(topic, 20)
    numbers = [wanted[key(image)] for image in received]
    stamps = [image.header.stamp_ns for image in received]
    if len(wanted) == FRAMES:  # in order; now and then some are left out for a newer one
        for (before, then), (after, now) in itertools.pairwise(zip(numbers, stamps, strict=True)):
            passed = round((now - then) / 40e6)
            assert 0 < (after - before) % FRAMES <= passed or passed >= FRAMES
    assert sorted(set(stamps)) == stamps
    assert {image.header.frame_id for image in received} == {"camera_optical"}
    assert {image.encoding for image in received} == {
        "mono8" if topic in ("/processed_image", "/edges") else "bgr8"
    }


def test_the_stamp_is_kept_from_the_source_to_the_edges(running: Running):
    raw, edges = running.runtime.subscribe("/image_raw"), running.runtime.subscribe("/edges")
    numbers = expected(running.images, "/image_raw")
    number_at: dict[int, int] = {}  # stamp -> the image that was taken then
    pairs: list[tuple[int, bytes]] = []

    def enough() -> bool:
        if (image := raw.take(0.005)) is not None:
            number_at[image.header.stamp_ns] = numbers[key(image)]
        if (image := edges.take(0.005)) is not None and image.header.stamp_ns in number_at:
            pairs.append((number_at[image.header.stamp_ns], key(image)))
        return len(pairs) >= 10

    wait_for(enough, "edges of images that were seen")
    for number, pixels in pairs:
        assert pixels in expected(running.images[number : number + 1], "/edges")


def test_a_parameter_changes_what_comes_out(running: Running):
    running.parameters("filters").update({"gray": False, "threshold_mode": "off"})
    subscription = running.runtime.subscribe("/processed_image")
    wait_for(lambda: (i := subscription.take(1)) and i.encoding == "bgr8", "colour")
    image = wait_for(lambda: subscription.take(1), "an image")
    subscription.close()
    assert key(image) in expected(running.images, "/image_raw")
    assert running.parameters("filters").current.gray is False


def test_a_refused_change_leaves_everything_as_it_was(running: Running):
    edges = running.parameters("edge_detector")
    before = edges.current
    with pytest.raises(ParameterError, match="800"):
        edges.update({"low": 5, "high": 100_000})
    assert edges.current == before
    with pytest.raises(ParameterError, match="canny"):
        edges.update({"method": "magic"})
    assert edges.current == before


def test_whoever_listens_is_told_of_a_change(running: Running):
    told: list[dict[str, Any]] = []
    forget = running.parameters("fps_control").on_change(
        lambda _, changed: told.append(dict(changed))
    )
    running.parameters("fps_control").update({"fps": 7})
    wait_for(lambda: told == [{"fps": 7}], "the change")
    forget()
    running.parameters("fps_control").update({"fps": 8})
    time.sleep(0.2)
    assert told == [{"fps": 7}]


def test_rate_control_lets_the_requested_rate_pass(running: Running):
    running.parameters("fps_control").update({"fps": 5})
    subscription = running.runtime.subscribe("/controlled_stream")

    def stamp_ns() -> int:
        return wait_for(lambda: subscription.take(1), "images").header.stamp_ns

    wait_for(lambda: abs(stamp_ns() - stamp_ns()) > 0.15e9, "the last of those that went before")
    stamps: list[int] = []

    def has_its_rate() -> bool:  # on a busy machine images are missed for a while
        stamps.append(stamp_ns())
        usual_s = float(np.median(np.diff(stamps[-10:]))) / 1e9 if len(stamps) >= 10 else 0.0
        return usual_s == pytest.approx(0.2, abs=0.02)

    wait_for(has_its_rate, "five images a second")
    subscription.close()
    gaps_s = np.diff(stamps) / 1e9
    assert gaps_s.sum() > 0.2 * (len(gaps_s) - 1)  # where one is missed the next comes at its time


def test_the_report_counts_every_node_and_topic(running: Running):
    edges = running.runtime.subscribe("/edges")

    def counted() -> bool:
        edges.take(0.1)
        nodes = running.runtime.report(2.0).nodes
        processed = all(nodes[running.prefix + name].processed > 0 for name in NODES)
        return processed and nodes[running.prefix + "fps_control"].requested_hz == 30

    wait_for(counted, "counts of all nodes")
    report = running.runtime.report(2.0)
    edges.close()
    assert report.topics["/edges"].type == "sensor_msgs/msg/Image"
    assert report.topics["/edges"].messages > 0
    node = report.nodes[running.prefix + "fps_control"]
    assert node.received >= node.processed
    assert isinstance(node.dropped, dict)


def test_a_recording_holds_what_was_published(running: Running, tmp_path: Path):
    path = tmp_path / "edges.mcap"
    recording = running.runtime.start_recording(path, topics=["/edges", "/image_raw"])
    wait_for(lambda: recording.written >= 20, "messages to be written")
    running.runtime.stop_recording(recording)
    assert recording.error is None
    with path.open("rb") as stream:
        channels = [channel.topic for _, channel, _ in make_reader(stream).iter_messages()]
    assert {"/edges", "/image_raw"} <= set(channels)
    assert set(channels) <= {"/edges", "/image_raw", "/camera_info", "/parameter_events"}
    assert len(channels) - channels.count("/parameter_events") == recording.written


def test_a_recording_is_split(running: Running, tmp_path: Path):
    split = Split(size=2**16)
    path = tmp_path / "r.mcap"
    recording = running.runtime.start_recording(path, topics=["/image_raw"], split=split)
    wait_for(lambda: recording.files >= 3, "three files")
    running.runtime.stop_recording(recording)
    assert (recording.error, recording.path) == (None, tmp_path / "r_0.mcap")
    names = [f"r_{number}.mcap" for number in range(recording.files)]
    assert sorted(one.name for one in tmp_path.iterdir()) == sorted(names)
    for name in names[:-1]:  # the last one may have a calibration, and its image not yet
        with (tmp_path / name).open("rb") as stream:
            topics = {channel.topic for _, channel, _ in make_reader(stream).iter_messages()}
        assert "/image_raw" in topics


def test_a_topic_that_there_is_not_cannot_be_recorded(running: Running, tmp_path: Path):
    with pytest.raises(UsageError, match="/edges"):
        running.runtime.start_recording(tmp_path / "x.mcap", topics=["/nothing"])


def test_a_recording_that_begins_and_ends_leaves_all_else_going(running: Running, tmp_path: Path):
    """Where the source can wait, the queues turn lossless by it, and live again."""
    watched = running.runtime.subscribe("/edges")
    for number in range(3):
        recording = running.runtime.start_recording(tmp_path / f"{number}.mcap", topics=["/edges"])
        wait_for(lambda r=recording: r.written >= 5, "messages to be written")
        running.runtime.stop_recording(recording)
        assert recording.error is None
        assert len({image.header.stamp_ns for image in running.take("/edges", 5)}) == 5
    while watched.take(0) is not None:
        pass
    wait_for(lambda: watched.take(1), "an image for who watched all the time")
    watched.close()
