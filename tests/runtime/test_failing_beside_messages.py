"""What nodes and sources raise where no message is at stake is counted, and ends nobody else."""

import pytest
from test_local import FRAMES, CounterParams, Run, _Counter, add, graph_of
from waiting import wait_for

from ros_visualise.core.declarations import action
from ros_visualise.core.errors import RosVisualiseError, UsageError
from ros_visualise.core.supervision import PROCESS
from ros_visualise.data import Image
from ros_visualise.nodes import node, source
from ros_visualise.runtime.report import to_json


def failing(*where):
    """A node that raises in these methods."""

    class Weak:
        def __init__(self, params):
            pass

        def step(self, image, params):
            return image

    def fail(self):
        raise ValueError("not here")

    for name in where:
        setattr(Weak, name, action("fails")(fail) if name == "press" else fail)
    return node("weak", inputs={"image": Image}, outputs={"image": Image})(Weak)


@pytest.mark.parametrize("where", ["finish", "report"])
def test_an_error_beside_messages_is_counted_and_costs_none(where, caplog):
    run = Run(graph_of(failing(where), add))
    weak = run.to_the_end().nodes["weak"]
    assert (weak.received, weak.processed, weak.dropped) == (FRAMES, FRAMES, {})
    assert weak.errors >= 1
    assert to_json(run.runtime.report())["nodes"]["weak"]["errors"] >= 1
    assert run.runtime.report().topics["/add/sum"].messages == FRAMES
    assert run.runtime.failed
    assert caplog.messages == ["weak: ValueError: not here (further occurrences suppressed)"]


def test_who_asks_for_an_action_hears_that_it_failed():
    run = Run(graph_of(failing("press")))
    with pytest.raises(RosVisualiseError, match="weak: press failed: ValueError: not here"):
        run.runtime.act("weak", "press")
    assert run.to_the_end().nodes["weak"].errors == 1
    assert run.runtime.failed


def test_a_refused_action_is_no_error_of_the_node(caplog):
    class Guarded:
        def __init__(self, params):
            pass

        def step(self, image, params):
            return image

        @action("is refused")
        def press(self):
            raise UsageError("press: use --allow-control")

    made = node("weak", inputs={"image": Image}, outputs={"image": Image})(Guarded)
    run = Run(graph_of(made))
    with pytest.raises(UsageError, match=r"^press: use --allow-control$"):
        run.runtime.act("weak", "press")
    assert run.to_the_end().nodes["weak"].errors == 0
    assert not run.runtime.failed
    assert not caplog.messages


def failing_source(*where):
    """A source that raises in these methods, and where ``frames`` is negative."""

    class Weak(_Counter):
        def __init__(self, params, playback):
            if params.frames < 0:
                raise ValueError("none")
            super().__init__(params, playback)

    def fail(self):
        raise ValueError("not here")

    for name in where:
        setattr(Weak, name, fail)
    return source("weak", params=CounterParams, outputs={"image": Image})(Weak)


@pytest.mark.parametrize("where", ["report", "close"])
def test_a_source_that_raises_beside_messages_ends_nobody(where):
    run = Run(graph_of(add, source_type=failing_source(where)))
    report = run.to_the_end()
    assert report.nodes["add"].processed == FRAMES
    [failed] = to_json(report)["failures"]
    assert (failed["who"], failed["kind"]) == ("counter", "ValueError")
    assert failed["place"].startswith("test_failing_beside_messages.py:")
    PROCESS.forget()


def test_a_source_that_cannot_begin_says_so_as_a_node_does():
    with pytest.raises(RosVisualiseError, match="counter cannot start: ValueError: none"):
        Run(graph_of(source_type=failing_source(), counter={"frames": -1}))


def test_a_source_that_raises_when_it_is_opened_anew_goes_on_as_before(caplog):
    run = Run(graph_of(source_type=failing_source()), hold=True)
    run.runtime.start()
    wait_for(lambda: run.playback.state.ended)
    run.runtime.parameters["counter"].update({"frames": -1})
    wait_for(lambda: caplog.messages)
    wait_for(lambda: run.runtime.parameters["counter"].current.frames == FRAMES)
    run.runtime.stop()
    assert "cannot start: ValueError: none" in caplog.text
    assert not run.runtime.failed


def test_an_action_gets_parameters_that_changed_since_the_last_message():
    pressed = []

    class Saving:
        def __init__(self, params):
            pass

        def step(self, image, params):
            return image

        @action("keep the parameters")
        def press(self, params):
            pressed.append(params.frames)

    ports = {"image": Image}
    made = node("saving", params=CounterParams, inputs=ports, outputs=ports)(Saving)
    run = Run(graph_of(made))
    run.runtime.parameters["saving"].update({"frames": 7})
    run.runtime.act("saving", "press")
    assert pressed == [7]
