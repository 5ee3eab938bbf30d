"""Looking at a graph that changes, with views that follow by themselves and such that do not."""

from types import SimpleNamespace

import pytest

from ros_visualise.graph import Graph
from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.ui import watch

EMPTY, FULL = Graph(None, ()), image_pipeline("landscape")


class Told:
    """A runtime whose graph changes with each spin, and the views that were opened on it."""

    def __init__(self, graphs):
        self.graphs = iter(graphs)
        self.runtime = SimpleNamespace(graph=next(self.graphs))
        self.said = []
        self.over = False
        self.closed = False

    def open_one(self):
        self.said.append("made")
        return self

    def open(self, runtime):
        self.said.append(runtime.graph)

    def spin(self, timeout_s):
        self.runtime.graph = next(self.graphs, None) or self.end()

    def end(self):
        self.over = True
        return self.runtime.graph

    def close(self):
        self.said.append("closed")

    def watch(self, reopens):
        watch(self.runtime, self.open_one, lambda: self.over, reopens)
        return self.said


def test_a_view_that_follows_is_opened_once_even_on_nothing():
    told = Told([EMPTY, FULL, EMPTY])
    assert told.watch(reopens=False) == ["made", EMPTY, "closed"]


def test_a_view_that_does_not_is_opened_anew_as_the_graph_changes():
    other = image_pipeline("landscape")
    told = Told([FULL, FULL, other])
    assert told.watch(reopens=True) == ["made", FULL, "closed", "made", other, "closed"]


def test_it_waits_for_something_to_show(monkeypatch):
    told = Told([EMPTY, EMPTY, FULL])
    monkeypatch.setattr("time.sleep", told.spin)
    assert told.watch(reopens=True) == ["made", FULL, "closed"]


def test_a_person_who_closes_the_view_ends_it():
    told = Told([FULL, FULL])
    told.closed = True
    assert told.watch(reopens=True) == ["made", FULL, "closed"]


def test_the_view_is_taken_away_when_it_fails():
    told = Told([FULL])
    told.spin = lambda _: 1 / 0
    with pytest.raises(ZeroDivisionError):
        told.watch(reopens=False)
    assert told.said == ["made", FULL, "closed"]
