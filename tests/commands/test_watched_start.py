"""The first minute of a run with a page: who it waits for, and what its tab is called."""

import sys
from types import SimpleNamespace

import pytest

from ros_visualise.commands import main
from ros_visualise.core.errors import UsageError
from ros_visualise.running import play
from ros_visualise.running.play import has_desktop


class Seen:
    """A view that somebody looks at after so many spins."""

    def __init__(self, spins):
        self.left = spins

    @property
    def awaited(self):
        return self.left > 0

    def spin(self, timeout_s):
        self.left -= 1


@pytest.mark.parametrize("spins", [0, 3])
def test_it_begins_when_somebody_looks(spins):
    view = Seen(spins)
    play._await_browser(view, SimpleNamespace(asked=False))
    assert view.left == 0


def test_it_waits_for_nobody_who_is_told_to_end_or_does_not_come(monkeypatch):
    view = Seen(5)
    play._await_browser(view, SimpleNamespace(asked=True))
    assert view.left == 5
    monkeypatch.setattr(play, "_PATIENCE_S", 0.0)
    play._await_browser(view, SimpleNamespace(asked=False))
    assert view.left == 5


@pytest.mark.parametrize(
    ("environment", "is_terminal", "expected"),
    [
        ({"DISPLAY": ":0"}, True, True),
        ({"WAYLAND_DISPLAY": "wayland-0"}, True, True),
        ({"DISPLAY": ":0"}, False, False),
        ({}, True, False),
        ({"DISPLAY": "localhost:10.0", "SSH_CONNECTION": "1 2 3 4"}, True, False),
    ],
)
def test_a_browser_opens_where_a_person_sees_it(monkeypatch, environment, is_terminal, expected):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: is_terminal)
    assert has_desktop(environment) is expected


@pytest.mark.parametrize(
    ("words", "title"),
    [
        ("video clips/flight.mp4", "flight.mp4 - ros_visualise"),
        ("kitti 2011_09_26/drive/", "drive - ros_visualise"),
        ("camera rtsp://me:secret@host/s", "camera - ros_visualise"),
        ("sim husky", "husky - ros_visualise"),
        ("demo", "demo - ros_visualise"),
        ("demo landscape", "landscape - ros_visualise"),
        ("explain canny", "canny - ros_visualise"),
    ],
)
def test_the_tab_is_named_after_what_is_shown(monkeypatch, words, title):
    titles = []

    def open_view(_, options):
        titles.append(options.title)
        raise UsageError("no view")

    monkeypatch.setattr(play, "graph_of", lambda *_: None)
    monkeypatch.setattr(play, "open_view", open_view)
    assert main(words.split()) == 2
    assert titles == [title]
