"""The local runtime, on small graphs of nodes made for it."""

import sys
import threading
from dataclasses import dataclass, replace

import numpy as np
import pytest
from waiting import wait_for

from ros_visualise.core.errors import OpenError, RosVisualiseError, UsageError
from ros_visualise.core.params import Parameters, param
from ros_visualise.data import Deferred, Header, Image
from ros_visualise.graph import Graph, Node, SourceNode
from ros_visualise.nodes import NoParams, node, source
from ros_visualise.nodes.fps_control import FpsControl
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.runtime.queues import Packet
from ros_visualise.runtime.report import TopicReport
from ros_visualise.runtime.runner import NodeRunner
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.playback import Playback

PERIOD_NS = round(1e9 / 30)
FRAMES = 40


@dataclass(frozen=True)
class CounterParams:
    frames: int = param(FRAMES, "how many", restart=True)


class Numbers:
    """A recording whose images hold their own number."""

    def __init__(self, frames):
        self.frames = frames
        self.duration_ns = frames * PERIOD_NS

    def read(self, start_ns):
        for number in range(min(start_ns // PERIOD_NS, max(self.frames - 1, 0)), self.frames):
            yield number * PERIOD_NS, Image(np.full((2, 3), number % 256, np.uint8), "mono8")


class _Counter:
    def __init__(self, params, playback):
        if params.frames < 0:
            raise OpenError("no frames: give at least 0")
        self.playback = playback
        self.recording = Numbers(params.frames)

    def messages(self):
        for stamp_ns, image in self.playback.run(self.recording):
            yield "image", replace(image, header=Header(stamp_ns, "camera"))

    def close(self):
        pass


counter = source("counter", params=CounterParams, outputs={"image": Image})(
    type("Counter", (_Counter,), {})
)
live_counter = source("live", params=CounterParams, outputs={"image": Image}, live=True)(
    type("Live", (_Counter,), {})
)


@dataclass(frozen=True)
class AddParams:
    amount: int = param(1, "what is added", min=0, max=100)


@node(
    "add",
    params=AddParams,
    inputs={"image": Image},
    outputs={"sum": Image, "extra": Image},
    on_demand=("extra",),
)
def add(image, params):
    """The image with something added."""
    pixels = image.pixels + np.uint8(params.amount)
    extra = Deferred(pixels.shape, np.uint8, lambda: pixels * 2)
    return {"sum": replace(image, data=pixels), "extra": replace(image, data=extra)}


def graph_of(*types, source_type=counter, **settings):
    source = counting(source_type)
    nodes = []
    for found in types:
        topic = next(iter([source, *nodes][-1].outputs.values()))
        declared = found.declared
        port = next(iter(declared.inputs))
        outputs = {name: f"/{declared.name}/{name}" for name in declared.outputs}
        nodes.append(Node(declared.name, declared, declared.params(), {port: topic}, outputs))
    return Graph(source, tuple(nodes)).configured(settings)


def counting(source_type=counter):
    outputs = {"image": "/image_raw"}
    return SourceNode("counter", source_type.declared, CounterParams(), {}, outputs)


class Run:
    """A runtime that is watched by a listener that loses nothing."""

    def __init__(self, graph, **playing):
        self.playback = Playback(**{"rate": 0, **playing})
        self.runtime = LocalRuntime(graph, self.playback)

    def to_the_end(self):
        self.runtime.start()
        assert self.runtime.wait(20)
        self.runtime.stop()
        return self.runtime.report()


def collector(values):
    @node("collector", inputs={"image": Image}, outputs={"image": Image})
    def collect(image, params):
        values.append((int(image.pixels[0, 0]), image.header, image))
        return image

    return collect


def test_every_message_passes_every_node_in_order_when_lossless():
    seen = []
    report = Run(graph_of(add, collector(seen))).to_the_end()
    assert [value for value, _, _ in seen] == list(range(1, FRAMES + 1))
    stamps = [header.stamp_ns for _, header, _ in seen]
    assert stamps == [i * PERIOD_NS for i in range(FRAMES)]
    assert {header.frame_id for _, header, _ in seen} == {"camera"}
    wall_hz = report.topics["/add/sum"].wall_hz
    told = TopicReport("sensor_msgs/msg/Image", FRAMES, hz=30.0, wall_hz=wall_hz)
    assert report.topics["/add/sum"] == told
    add_report = report.nodes["add"]
    counts = add_report.received, add_report.processed, add_report.dropped
    assert counts == (FRAMES, FRAMES, {})
    assert 0 < add_report.step_ms <= add_report.p50_ms <= add_report.p99_ms


def test_images_pass_by_reference():
    first, second = [], []
    collect_again = replace(collector(second).declared, name="again")
    again = type("Again", (), {"declared": collect_again})
    Run(graph_of(collector(first), again)).to_the_end()
    assert all(a is b for (_, _, a), (_, _, b) in zip(first, second, strict=True))
    assert len(first) == FRAMES


def test_rate_control_drops_are_counted_by_reason():
    report = Run(graph_of(FpsControl, add, fps_control={"fps": 10})).to_the_end()
    control = report.nodes["fps_control"]
    assert control.dropped == {"rate": FRAMES - 14}
    assert (control.requested_hz, control.achieved_hz) == (10, 10.0)
    assert report.nodes["add"].received == 14


def test_without_lossless_a_slow_node_gets_the_newest_and_drops_are_counted():
    entered, go_on = threading.Event(), threading.Event()
    seen = []

    @node("slow", inputs={"image": Image}, outputs={"image": Image})
    def slow(image, params):
        seen.append(int(image.pixels[0, 0]))
        entered.set()
        go_on.wait(10)
        return image

    run = Run(graph_of(slow), rate=100, hold=True)
    run.playback.step()
    run.runtime.start()
    assert entered.wait(10)
    run.playback.play()
    wait_for(lambda: run.playback.state.ended)
    go_on.set()
    wait_for(lambda: len(seen) >= 2)
    run.runtime.stop()
    report = run.runtime.report()
    assert seen[-1] == FRAMES - 1
    assert report.nodes["slow"].dropped == {"queue": FRAMES - len(seen)}
    assert report.nodes["slow"].received == FRAMES
    assert report.topics["/image_raw"].messages == FRAMES


def test_a_subscription_tells_the_end_of_its_topic_from_a_timeout():
    run = Run(graph_of(add))
    subscription = run.runtime.subscribe("/add/sum", depth=FRAMES)
    assert subscription.take(0) is None
    assert not subscription.ended
    run.runtime.start()
    assert run.runtime.wait(10)
    while subscription.take(0) is not None:
        pass
    assert subscription.ended


def test_an_unknown_topic_is_answered_by_the_known_ones():
    runtime = Run(graph_of(add)).runtime
    for ask in (runtime.subscribe, runtime.topic):
        with pytest.raises(UsageError, match="no topic '/add/sun'; did you mean /add/sum"):
            ask("/add/sun")


def test_a_subscription_starts_with_the_last_message():
    run = Run(graph_of(add), hold=True)
    run.runtime.start()
    wait_for(lambda: run.playback.state.ended)
    subscription = run.runtime.subscribe("/add/sum")
    seen = set()
    while FRAMES not in seen:
        image = subscription.take(10)
        seen.add(int(image.pixels[0, 0]))
    assert subscription.take(0) is None
    subscription.close()
    run.runtime.stop()


def test_an_output_on_demand_counts_only_while_somebody_looks():
    unwatched = Run(graph_of(add)).to_the_end()
    assert "/add/extra" not in unwatched.topics
    run = Run(graph_of(add))
    subscription = run.runtime.subscribe("/add/extra")
    report = run.to_the_end()
    assert report.topics["/add/extra"].messages == FRAMES
    assert subscription.take(0).pixels[0, 0] == 2 * FRAMES


def test_parameters_change_between_messages():
    seen = []
    run = Run(graph_of(add, collector(seen)), hold=True, rate=1, frames=None)
    run.playback.step()
    run.runtime.start()
    wait_for(lambda: seen)
    run.runtime.parameters["add"].update({"amount": 50})
    wait_for(lambda: len(seen) >= 2)
    run.runtime.stop()
    (before, header, _), (after, again, _) = seen[:2]
    assert (after - before, again) == (49, header)  # while paused, the same image once more


def test_a_node_that_calls_exit_loses_that_message_and_this_is_said(caplog):
    @node("leaves", inputs={"image": Image}, outputs={"image": Image})
    def leaves(image, params):
        sys.exit(7)

    run = Run(graph_of(leaves))
    report = run.to_the_end()
    assert report.nodes["leaves"].dropped == {"error": FRAMES}
    assert run.runtime.failed
    assert [record.getMessage() for record in caplog.records] == [
        "leaves: SystemExit: 7 (further occurrences suppressed)"
    ]


def test_a_node_that_raises_loses_that_message_alone(caplog):
    @node("fails", inputs={"image": Image}, outputs={"image": Image})
    def fails(image, params):
        if image.pixels[0, 0] % 10 == 3:
            raise RosVisualiseError("does not like threes")
        return image

    run = Run(graph_of(fails))
    report = run.to_the_end()
    assert report.nodes["fails"].dropped == {"error": 4}
    assert report.topics["/fails/image"].messages == FRAMES - 4
    assert run.runtime.failed
    assert [record.getMessage() for record in caplog.records] == [
        "fails: does not like threes (further occurrences suppressed)"
    ]


def test_a_bug_in_a_node_shows_its_traceback(caplog):
    @node("broken", inputs={"image": Image}, outputs={"image": Image})
    def broken(image, params):
        return image.no_such_thing

    run = Run(graph_of(broken))
    run.to_the_end()
    assert "Traceback" in caplog.text
    assert "no_such_thing" in caplog.text


def test_a_stateful_node_is_reset_when_time_jumps_back_and_finishes_at_the_end():
    log = []

    @node("stateful", inputs={"image": Image}, outputs={"image": Image})
    class Stateful:
        def __init__(self, params):
            self.last = None

        def step(self, image, params):
            self.last = image
            log.append(int(image.pixels[0, 0]))

        def reset(self):
            log.append("reset")

        def finish(self):
            return self.last

    run = Run(graph_of(Stateful), hold=True)
    run.runtime.start()
    wait_for(lambda: run.playback.state.ended)
    run.playback.seek(38 * PERIOD_NS / 1e9 + 0.001)
    run.playback.play()
    wait_for(lambda: len(log) >= FRAMES + 3)
    run.playback.close()
    assert run.runtime.wait(10)
    assert log == [*range(FRAMES), "reset", 38, 39]
    assert run.runtime.report().topics["/stateful/image"].messages == 1


def test_a_stateful_node_is_reset_by_a_jump_ahead_and_by_a_source_that_is_opened_anew():
    log = []

    @node("stateful", inputs={"image": Image}, outputs={"image": Image})
    class Stateful:
        def __init__(self, params):
            pass

        def step(self, image, params):
            log.append(int(image.pixels[0, 0]))

        def reset(self):
            log.append("reset")

    run = Run(graph_of(Stateful), hold=True)
    run.playback.pause()
    run.runtime.start()
    wait_for(lambda: log == [0])
    run.playback.seek(20 * PERIOD_NS / 1e9 + 0.001)
    wait_for(lambda: log[-1:] == [20])
    run.playback.step()
    wait_for(lambda: log[-1:] == [21])
    run.runtime.parameters["counter"].update({"frames": 30})
    wait_for(lambda: len(log) == 6)
    assert log == [0, "reset", 20, 21, "reset", 21]
    run.runtime.stop()


def test_two_inputs_may_listen_to_one_topic():
    got = []

    @node("both", inputs={"left": Image, "right": Image}, outputs={"image": Image})
    class Both:
        def __init__(self, params):
            pass

        def step(self, params, left=None, right=None):
            got.append("left" if right is None else "right")

    inputs = {"left": "/image_raw", "right": "/image_raw"}
    both = Node("both", Both.declared, Both.declared.params(), inputs, {"image": "/out"})
    runtime = LocalRuntime(Graph(counting(), (both,)), Playback(rate=0))
    runtime.start()
    assert runtime.wait(20)
    runtime.stop()
    assert sorted(got) == ["left"] * FRAMES + ["right"] * FRAMES


def test_a_node_of_two_ways_is_reset_once_by_one_seek():
    log = []

    @node("joined", inputs={"near": Image, "far": Image}, outputs={"image": Image})
    class Joined:
        def __init__(self, params):
            pass

        def step(self, params, near=None, far=None):
            log.append((near or far).header.stamp_ns)

        def reset(self):
            log.append("reset")

    inputs = {"near": "/near", "far": "/far"}
    joined = Node("joined", Joined.declared, Joined.declared.params(), inputs, {"image": "/out"})
    runner = NodeRunner(joined, Parameters(joined.params))

    def step(port, stamp_ns, epoch):
        image = Image(np.zeros((2, 2), np.uint8), "mono8", Header(stamp_ns))
        runner.step(Packet(0, image, 0, port, epoch=epoch))

    for port, stamp_ns, epoch in [
        *(("near", 1, 0), ("far", 1, 0), ("near", 2, 0)),
        *(("near", 50, 1), ("far", 2, 0), ("far", 50, 1), ("near", 51, 1), ("far", 51, 1)),
    ]:
        step(port, stamp_ns, epoch)
    assert log == [1, 1, 2, "reset", 50, 50, 51, 51]
    assert runner.report().dropped == {"stale": 1}


def test_figures_are_asked_for_between_two_steps():
    @node("counting", inputs={"image": Image}, outputs={"image": Image})
    class Counting:
        def __init__(self, params):
            self.seen = {}

        def step(self, image, params):
            for number in range(2000):
                self.seen[number] = self.seen.get(number, 0) + 1
            self.seen.clear()

        def report(self):
            return {"open": sum(1 for _ in self.seen)}

    run = Run(graph_of(Counting), loop=True, rate=0)
    run.runtime.start()
    wait_for(lambda: run.runtime.report().nodes["counting"].processed > 5)
    reports = [run.runtime.report().nodes["counting"] for _ in range(300)]
    run.runtime.stop()
    assert {report.own["open"] for report in reports} == {0}
    assert not run.runtime.failed


def test_a_long_step_holds_up_nobody_who_asks_for_figures():
    free = threading.Event()

    @node("slow", inputs={"image": Image}, outputs={"image": Image})
    class Slow:
        def __init__(self, params):
            pass

        def step(self, image, params):
            assert free.wait(20)

        def report(self):
            return {"figure": 7}

    run = Run(graph_of(Slow))
    run.runtime.start()
    wait_for(lambda: run.runtime.report().nodes["slow"].received == 1)
    assert run.runtime.report().nodes["slow"].received == 1
    free.set()
    run.runtime.stop()


def test_each_lap_resets_what_nodes_remember_while_the_stamps_go_on():
    seen = []

    @node("stateful", inputs={"image": Image}, outputs={"image": Image})
    class Stateful:
        def __init__(self, params):
            pass

        def step(self, image, params):
            seen.append((int(image.pixels[0, 0]), image.header.stamp_ns))

        def reset(self):
            seen.append("reset")

    run = Run(graph_of(Stateful), loop=True)
    run.runtime.start()
    wait_for(lambda: len(seen) > 2 * FRAMES + 5)
    run.runtime.stop()
    assert [at for at, one in enumerate(seen) if one == "reset"][:2] == [FRAMES, 2 * FRAMES + 1]
    passed = [one for one in seen if one != "reset"][: 2 * FRAMES]
    assert [value for value, _ in passed] == [*range(FRAMES)] * 2
    stamps = [stamp for _, stamp in passed]
    assert stamps == sorted(set(stamps))


def test_stopping_ends_every_thread_even_when_a_queue_is_full():
    hold = threading.Event()

    @node("stuck", inputs={"image": Image}, outputs={"image": Image})
    def stuck(image, params):
        hold.wait(0.2)
        return image

    run = Run(graph_of(add, stuck), loop=True)
    run.runtime.start()
    wait_for(lambda: run.runtime.report().nodes["stuck"].received)
    run.runtime.stop()
    assert run.runtime.wait(5)


def test_a_live_source_is_never_held_up():
    entered, go_on = threading.Event(), threading.Event()

    @node("slow", inputs={"image": Image}, outputs={"image": Image})
    def slow(image, params):
        entered.set()
        go_on.wait(10)
        return image

    run = Run(graph_of(slow, source_type=live_counter))
    run.runtime.start()
    wait_for(lambda: run.runtime.report().topics["/image_raw"].messages == FRAMES)
    go_on.set()
    assert run.runtime.wait(10)
    assert run.runtime.report().nodes["slow"].dropped["queue"] >= FRAMES - 3


@pytest.mark.parametrize("rate", [0, 1])
def test_a_run_of_no_frames_ends(rate):
    run = Run(graph_of(add, counter={"frames": 0}), rate=rate)
    assert run.to_the_end().topics["/image_raw"].messages == 0


def test_a_source_is_opened_anew_when_its_parameters_ask_for_it():
    seen = []
    run = Run(graph_of(collector(seen)), hold=True)
    run.runtime.start()
    wait_for(lambda: run.playback.state.ended)
    run.runtime.parameters["counter"].update({"frames": 3})
    wait_for(lambda: len(seen) == FRAMES + 1)
    run.runtime.stop()
    assert [value for value, _, _ in seen] == [*range(FRAMES), 2]  # it goes on where it was


def test_a_source_is_closed_where_a_node_cannot_be_made():
    closed = []

    @source("closing", params=CounterParams, outputs={"image": Image})
    class Closing(_Counter):
        def close(self):
            closed.append(True)

    @node("broken", inputs={"image": Image}, outputs={"image": Image})
    class Broken:
        def __init__(self, params):
            raise OpenError("no table: give one")

        def step(self, image, params):
            pass

    graph = Graph(
        SourceNode("closing", Closing.declared, CounterParams(), {}, {"image": "/in"}),
        (Node("broken", Broken.declared, NoParams(), {"image": "/in"}, {"image": "/out"}),),
    )
    with pytest.raises(OpenError, match="no table"):
        LocalRuntime(graph, Playback())
    assert closed == [True]


def test_a_source_that_cannot_be_opened_anew_plays_on(caplog):
    seen = []
    run = Run(graph_of(collector(seen)), hold=True)
    run.runtime.start()
    wait_for(lambda: run.playback.state.ended)
    run.runtime.parameters["counter"].update({"frames": -1})
    wait_for(lambda: len(seen) == FRAMES + 1)
    run.runtime.stop()
    assert caplog.messages == ["no frames: give at least 0"]
    assert run.runtime.parameters["counter"].current.frames == FRAMES
    assert not run.runtime.failed


def test_one_recording_can_end_while_another_goes_on(tmp_path):
    run = Run(graph_of(add), hold=True)
    first = run.runtime.start_recording(tmp_path / "first.mcap")
    second = run.runtime.start_recording(tmp_path / "second.mcap", topics=["/add/extra"])
    run.runtime.start()
    wait_for(lambda: run.playback.state.ended)
    wait_for(lambda: (first.written, second.written) == (2 * FRAMES, FRAMES))
    run.runtime.stop_recording(second)
    run.playback.play()
    wait_for(lambda: first.written == 4 * FRAMES)
    run.runtime.stop()
    assert (second.written, run.runtime.failed) == (FRAMES, False)
    assert "/add/extra" in run.runtime.report().topics


def test_what_a_node_says_at_the_end_is_recorded_after_all_else(tmp_path):
    @node("keeper", inputs={"image": Image}, outputs={"image": Image})
    class Keeper:
        def __init__(self, params):
            self.last = None

        def step(self, image, params):
            self.last = image
            return image

        def finish(self):
            return self.last

    run = Run(graph_of(Keeper, add))
    run.runtime.start_recording(tmp_path / "out.mcap")
    run.to_the_end()
    recording = open_recording(tmp_path / "out.mcap")
    topics = [entry.topic for entry in recording.read()]
    recording.close()
    assert topics[-5:] == ["/image_raw", *["/keeper/image", "/add/sum"] * 2]


WRONG = {
    "pixels": (lambda image: image.pixels, "returns image: ndarray, but declares image"),
    "a tuple": (lambda image: (image, image), "returns image: tuple"),
    "another output": (lambda image: {"edges": image}, "returns edges: Image"),
}


@pytest.mark.parametrize(("answer", "says"), WRONG.values(), ids=WRONG)
def test_a_node_that_answers_wrongly_loses_its_messages_alone(answer, says, caplog, tmp_path):
    @node("wrong", inputs={"image": Image}, outputs={"image": Image})
    def wrong(image, params):
        return answer(image)

    run = Run(graph_of(wrong))
    run.runtime.start_recording(tmp_path / "out.mcap")
    report = run.to_the_end()
    assert report.nodes["wrong"].dropped == {"error": FRAMES}
    assert report.topics["/wrong/image"].messages == 0
    [message] = caplog.messages
    assert says in message


def test_a_node_that_breaks_elsewhere_than_in_its_step_ends_the_run_all_the_same(caplog):
    @node("breaks", inputs={"image": Image}, outputs={"image": Image})
    class Breaks:
        def __init__(self, params):
            pass

        def step(self, image, params):
            raise ValueError(f"frame {image.pixels[0, 0]}")

        def finish(self):
            raise KeyError("finish")

        def report(self):
            raise OSError("report")

    run = Run(graph_of(Breaks, add))
    report = run.to_the_end()
    assert report.nodes["breaks"].dropped == {"error": FRAMES}
    assert run.runtime.failed
    assert len([m for m in caplog.messages if "frame" in m]) == 1


def test_a_node_without_outputs_counts():
    seen = []

    @node("count", inputs={"image": Image}, outputs={})
    def count(image, params):
        seen.append(image)

    report = Run(graph_of(count)).to_the_end()
    assert len(seen) == report.nodes["count"].processed == FRAMES


def test_while_paused_the_last_image_that_came_is_repeated():
    seen = []
    run = Run(graph_of(FpsControl, add, collector(seen), fps_control={"fps": 10}), hold=True)
    run.playback.step(2)  # of which the second is left out
    run.runtime.start()
    wait_for(lambda: run.runtime.report().nodes["fps_control"].received == 2)
    wait_for(lambda: seen)
    run.runtime.parameters["add"].update({"amount": 9})
    wait_for(lambda: len(seen) == 2)
    run.runtime.stop()
    assert [value for value, _, _ in seen] == [1, 9]
    assert run.runtime.report().nodes["collector"].p99_ms < 5000


def test_a_file_is_recorded_to_once_at_a_time(tmp_path):
    run = Run(graph_of(add))
    run.runtime.start_recording(tmp_path / "out.mcap")
    with pytest.raises(UsageError, match="recording to it"):
        run.runtime.start_recording(tmp_path / "out.mcap", overwrite=True)
    run.runtime.stop()


class _Sparing(_Counter):
    """Says in each image whether somebody wanted it."""

    def set_demand(self, wants):
        self.wants = wants

    def messages(self):
        for output, image in super().messages():
            wanted = np.full((2, 3), self.wants("image"), np.uint8)
            yield output, replace(image, data=wanted)


sparing = source("sparing", params=CounterParams, outputs={"image": Image})(
    type("Sparing", (_Sparing,), {})
)


class Asked:
    """A listener that wants every other message."""

    def __init__(self):
        self.taken = []

    def wants(self):
        return len(self.taken) % 2 == 1

    def put(self, packet):
        self.taken.append(bool(packet.message.pixels[0, 0]))

    def close(self):
        pass


@pytest.mark.parametrize("others", [(), (add,)])
def test_a_source_knows_what_nobody_wants(others):
    run = Run(graph_of(*others, source_type=sparing, counter={"frames": 6}))
    asked = Asked()
    run.runtime.topic("/image_raw").connect(asked, wants=asked.wants)
    run.to_the_end()
    every_other = [False, True, False, True, False, True]
    assert asked.taken == ([True] * 6 if others else every_other)


def test_a_topic_by_itself_counts_as_wanted():
    run = Run(graph_of(source_type=sparing, counter={"frames": 1}))
    run.to_the_end()
    assert run.runtime.topic("/image_raw").awaited


def test_where_messages_come_from_outside_a_node_is_asked_what_is_due():
    @node("keeper", inputs={"image": Image}, outputs={"image": Image})
    class Keeper:
        def __init__(self, params):
            self.kept = None

        def step(self, image, params):
            self.kept = image

        def tick(self, params):
            kept, self.kept = self.kept, None
            return kept

    declared = Keeper.declared
    keeper = Node("keeper", declared, declared.params(), {"image": "/in"}, {"image": "/out"})
    runtime = LocalRuntime(Graph(None, (keeper,)), None)
    subscription = runtime.subscribe("/out")
    runtime.start()
    image = Image(np.zeros((2, 3), np.uint8), "mono8")
    runtime.publish("/in", image)
    wait_for(lambda: subscription.take(1) is image)
    runtime.stop()
    assert not runtime.failed


def test_in_a_recording_none_is_for_two_runs_would_differ():
    asked = []

    @node("keeper", inputs={"image": Image}, outputs={"image": Image})
    class Keeper:
        def __init__(self, params):
            pass

        def step(self, image, params):
            return image

        def tick(self, params):
            asked.append(True)

    run = Run(graph_of(Keeper), hold=True)
    run.runtime.start()
    wait_for(lambda: run.playback.state.ended)
    run.runtime.wait(0.3)
    run.runtime.stop()
    assert not asked
