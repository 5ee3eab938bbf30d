"""Nodes that join several inputs, in running graphs: which sets they get, and what is dropped."""

import random
import threading
import time
from dataclasses import dataclass

import numpy as np
import pytest
from mcap.reader import make_reader
from test_local import FRAMES, PERIOD_NS, CounterParams, counter, live_counter
from waiting import wait_for

from ros_visualise.core.params import param
from ros_visualise.core.synchronizer import Approximate, Exact, Latest
from ros_visualise.data import Header, Image, PoseArray
from ros_visualise.graph import Graph, SourceNode, place
from ros_visualise.nodes import node
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.playback import Playback


@dataclass(frozen=True)
class Shift:
    by: int = param(0, "metres", min=0, max=9)


def boxes_of(image, late_ns=0):
    """Something small that was found in an image; its x is the image's number."""
    number = int(image.pixels[0, 0])
    stamp_ns = image.header.stamp_ns + late_ns
    position = np.array([[number, 0.0, 0.0]])
    return PoseArray(position, np.array([[0, 0, 0, 1.0]]), Header(stamp_ns, "camera"))


def finder(every=1, late_ns=0, seed=None, name="finder"):
    """Finds something in some images, in its own time."""
    choose = random.Random(seed)

    @node(name, inputs={"image": Image}, outputs={"boxes": PoseArray})
    def find(image, params):
        time.sleep(choose.random() / 300 if seed is not None else 0)
        found = boxes_of(image, late_ns)
        return found if found.positions_xyz[0, 0] % every == 0 else None

    return find


def joined(join, got, seed=None, outputs=None):
    choose = random.Random(seed)

    @node(
        "joined",
        inputs={"image": Image, "boxes": PoseArray},
        outputs=outputs or {"boxes": PoseArray},
        sync=join,
    )
    def work(image, boxes, params):
        time.sleep(choose.random() / 300 if seed is not None else 0)
        got.append((int(image.pixels[0, 0]), int(boxes.positions_xyz[0, 0])))
        return boxes

    return work


def diamond(find, work, source=counter, image="/image_raw"):
    """A source, what finds something in its images, and what joins the two."""
    start = SourceNode("counter", source.declared, CounterParams(), {}, {"image": "/image_raw"})
    inputs = {"image": image, "boxes": "/found"}
    nodes = [
        place(find.declared, {"image": "/image_raw"}, {"boxes": "/found"}),
        place(work.declared, inputs, {"boxes": "/joined"}),
    ]
    return Graph(start, tuple(nodes))


def run(graph, record=None, topics=(), **playing):
    runtime = LocalRuntime(graph, Playback(**{"rate": 0, **playing}))
    if record is not None:
        runtime.start_recording(record, topics=topics)
    runtime.start()
    assert runtime.wait(60)
    runtime.stop()
    assert not runtime.failed
    return runtime.report().nodes["joined"]


def test_images_come_with_what_was_found_in_them():
    got = []
    report = run(diamond(finder(seed=1), joined(Exact(), got)))
    assert got == [(number, number) for number in range(FRAMES)]
    assert report.received == 2 * FRAMES
    assert report.processed == FRAMES
    assert report.dropped == {}


def test_images_in_which_nothing_was_found_are_dropped_and_counted():
    got = []
    report = run(diamond(finder(every=3), joined(Exact(), got)))
    assert got == [(number, number) for number in range(0, FRAMES, 3)]
    assert report.dropped == {"unmatched image": FRAMES - len(got)}


def test_what_is_found_after_many_more_images_blocks_nothing():
    @node("finder", inputs={"image": Image}, outputs={"boxes": PoseArray})
    class Late:
        def __init__(self, params):
            self.waiting = []

        def step(self, image, params):
            self.waiting.append(image)
            return boxes_of(self.waiting.pop(0)) if len(self.waiting) > 20 else None

    got = []
    report = run(diamond(Late, joined(Exact(), got)))
    assert got == [(number, number) for number in range(FRAMES - 20)]
    assert report.dropped == {"unmatched image": 20}


def test_near_stamps_are_joined_where_that_is_enough():
    got = []
    run(diamond(finder(late_ns=PERIOD_NS // 3), joined(Approximate(0.02), got)))
    assert got == [(number, number) for number in range(FRAMES)]


def test_the_latest_goes_with_every_image_from_the_first_on():
    got = []
    report = run(diamond(finder(every=10, seed=3), joined(Latest("image"), got, seed=4)))
    numbers = [number for number, _ in got]
    assert numbers[0] in (0, 1)  # what is found in an image is told after it
    assert numbers == list(range(numbers[0], FRAMES))
    assert all(number - 10 <= found <= number for number, found in got)
    assert report.dropped == ({"unmatched image": 1} if numbers[0] else {})


@pytest.mark.parametrize("join", [Exact(), Approximate(0.05), Latest("image"), Latest("boxes")])
def test_the_same_input_is_joined_and_recorded_alike_however_the_threads_run(join, tmp_path):
    gots, files = [], []
    for seed in range(3):
        got = []
        late_ns = 0 if join == Exact() else 2 * PERIOD_NS // 3
        graph = diamond(finder(3, late_ns, seed), joined(join, got, seed))
        path = tmp_path / f"{seed}.mcap"
        run(graph, path, ["/image_raw", "/found", "/joined"])
        gots.append(got)
        files.append(contents(path))
    assert gots[0] == gots[1] == gots[2]
    assert len(gots[0]) > 10
    assert files[0] == files[1] == files[2]


def contents(path):
    with path.open("rb") as stream:
        return [
            (channel.topic, message.log_time, message.publish_time)
            for _, channel, message in make_reader(stream).iter_messages(log_time_order=False)
            if channel.topic != "/parameter_events"
        ]


def test_a_node_that_joins_answers_every_number_and_so_holds_up_no_recorder(tmp_path):
    graph = diamond(finder(every=1000), joined(Exact(), []))
    runtime = LocalRuntime(graph, Playback(rate=0, hold=True))
    recording = runtime.start_recording(tmp_path / "r.mcap", topics=["/image_raw", "/joined"])
    runtime.start()
    wait_for(lambda: recording.written == FRAMES + 1)  # while the source holds at its end
    runtime.stop()


def test_inputs_that_are_never_joined_are_told_of_once_with_their_stamps(caplog):
    got = []
    run(diamond(finder(late_ns=5), joined(Exact(), got)))
    assert got == []
    (said,) = [r.getMessage() for r in caplog.records if "no messages matched" in r.getMessage()]
    assert said.startswith("joined: no messages matched by Exact() yet: ")
    assert "on /image_raw, stamps up to 0." in said
    assert "on /found, stamps up to 0." in said


def test_an_input_on_which_nothing_comes_is_named(caplog):
    @node("finder", inputs={"image": Image}, outputs={"boxes": PoseArray})
    def nothing(image, params):
        return None

    run(diamond(nothing, joined(Exact(), [])))
    (said,) = [r.getMessage() for r in caplog.records if "no messages matched" in r.getMessage()]
    assert "20 on /image_raw, stamps up to 0.633333 s, no message on /found" in said


def test_after_a_seek_nothing_from_before_it_is_joined_and_the_node_is_reset_once():
    log = []

    @node(
        "joined",
        inputs={"image": Image, "boxes": PoseArray},
        outputs={"boxes": PoseArray},
        sync=Exact(),
    )
    class Work:
        def __init__(self, params):
            pass

        def step(self, image, boxes, params):
            assert image.header.stamp_ns == boxes.header.stamp_ns
            log.append(image.header.stamp_ns)

        def reset(self):
            log.append("reset")

    graph = diamond(finder(seed=1), Work)
    playback = Playback(rate=0, hold=True)
    runtime = LocalRuntime(graph, playback)
    runtime.start()
    wait_for(lambda: playback.state.ended and len(log) == FRAMES)
    playback.seek(0.0)
    wait_for(lambda: 0 in log[FRAMES:])
    playback.play()
    wait_for(lambda: log[-1] == (FRAMES - 1) * PERIOD_NS)
    runtime.stop()
    assert not runtime.failed
    assert log.count("reset") == 1


def test_live_the_newest_set_is_taken_and_the_others_are_counted():
    entered, go_on = threading.Event(), threading.Event()
    got = []

    @node(
        "joined",
        inputs={"image": Image, "boxes": PoseArray},
        outputs={"boxes": PoseArray},
        sync=Exact(),
    )
    def slow(image, boxes, params):
        got.append(int(image.pixels[0, 0]))
        entered.set()
        assert go_on.wait(20)

    playback = Playback(rate=100, hold=True)
    runtime = LocalRuntime(diamond(finder(), slow), playback)
    playback.step()
    runtime.start()
    assert entered.wait(20)
    playback.play()
    wait_for(lambda: playback.state.ended)
    wait_for(lambda: runtime.report().nodes["finder"].received == FRAMES)
    go_on.set()
    wait_for(lambda: len(got) == 2)
    runtime.stop()
    assert got[1] >= FRAMES - 3
    dropped = runtime.report().nodes["joined"].dropped
    assert dropped["queue"] > 0


def test_a_paused_node_shows_what_new_parameters_do_with_the_set_before():
    got = []

    @node(
        "joined",
        params=Shift,
        inputs={"image": Image, "boxes": PoseArray},
        outputs={"boxes": PoseArray},
        sync=Exact(),
    )
    def shifted(image, boxes, params):
        got.append((int(image.pixels[0, 0]), params.by))

    playback = Playback(rate=1, hold=True)
    runtime = LocalRuntime(diamond(finder(), shifted), playback)
    playback.step()
    runtime.start()
    wait_for(lambda: len(got) == 1)
    runtime.parameters["joined"].update({"by": 5})
    wait_for(lambda: len(got) == 2)
    runtime.stop()
    assert got[1] == (got[0][0], 5)


def test_a_live_source_is_joined_as_it_comes():
    got = []
    runtime = LocalRuntime(
        diamond(finder(), joined(Exact(), got), live_counter), Playback(live_stamps=True)
    )
    runtime.start()
    wait_for(lambda: len(got) > 5)
    runtime.stop()
    assert all(image == found for image, found in got)
