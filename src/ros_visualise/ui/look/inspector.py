"""Answers the queries of the pages that inspect a graph."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path

from ros_visualise.core.errors import RosVisualiseError, did_you_mean
from ros_visualise.plotting.colors import PALETTE, css
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.live.monitor import LogLines, NodeMonitor
from ros_visualise.ui.live.taps import Taps
from ros_visualise.ui.live.trees import tree_of
from ros_visualise.ui.look.curves import Curves
from ros_visualise.ui.server.answers import READ_ONLY, Answer, BrowserQuery, Refusal, as_json

log = logging.getLogger(__name__)

_ICON = """<link rel="icon" href="data:image/svg+xml,%3Csvg xmlns='http://www.w3.org/2000/svg' \
viewBox='0 0 16 16'%3E%3Ccircle cx='8' cy='8' r='7' fill='%23228be6'/%3E\
%3Ccircle cx='8' cy='8' r='3' fill='white'/%3E%3C/svg%3E">"""
_FOLDER = Path(__file__).parent / "pages"
PAGES = {
    "plots": "show_chart",
    "messages": "data_object",
    "log": "article",
    "diagnostics": "monitor_heart",
}
"""Name of a page -> its icon, by its name among Material Icons."""
_WAIT_S = 0.5


class Inspector:
    """Answers queries about a running graph, from any thread."""

    def __init__(self, runtime: Runtime) -> None:
        self._runtime = runtime
        self._messages = Taps(runtime, 1)
        self._curves = Curves(runtime)
        self._lines = LogLines()
        self._monitor = NodeMonitor(runtime, self._lines)
        logging.getLogger("ros_visualise").addHandler(self._lines)
        self._answers: Mapping[str, Callable[[BrowserQuery], Answer]] = {
            "message": self._message,
            "fields": self._curves.fields,
            "curves": self._curves.curves,
            "log": self._log,
            "diagnostics": self._diagnostics,
        }
        self._acts: Mapping[str, Callable[[BrowserQuery], Answer]] = {"play": self._play}

    def answer(self, query: BrowserQuery, is_viewer: bool = False) -> Answer | None:
        """The answer to a query, read-only for ``is_viewer``; None leaves it to viser."""
        try:
            return self._answer(query, is_viewer)
        except Refusal as refusal:
            return refusal.answer
        except (RosVisualiseError, ValueError) as error:  # such as an image that is damaged
            return as_json({"error": str(error)}, 422)

    def refresh(self) -> None:
        """Take log and diagnostics; unsubscribe from topics without recent queries."""
        self._monitor.take()
        self._messages.rest()
        self._curves.rest()

    def close(self) -> None:
        """Unsubscribe from all topics."""
        logging.getLogger("ros_visualise").removeHandler(self._lines)
        self._messages.rest(all_of_them=True)
        self._curves.close()
        self._monitor.close()

    def _answer(self, query: BrowserQuery, is_viewer: bool) -> Answer | None:
        if "look" in query:
            return _page(query.text("look"))
        if "ask" not in query:
            return None
        asked = query.text("ask")
        if asked in self._acts and is_viewer:
            raise Refusal(READ_ONLY, 403)
        if asked == "topics":
            return self._topics(is_viewer)
        answers = {**self._answers, **self._acts}
        if asked not in answers:
            raise Refusal(f"unknown query{did_you_mean(asked, answers)}", 404)
        return answers[asked](query)

    def _topics(self, is_viewer: bool) -> Answer:
        topics = self._runtime.graph.topics
        return as_json(
            {
                "topics": {name: one.ros.name for name, one in topics.items()},
                "plotted": self._curves.topics,
                "plays": self._runtime.playback is not None and not is_viewer,
            }
        )

    def _message(self, query: BrowserQuery) -> Answer:
        topic = query.text("topic")
        if topic not in self._runtime.graph.topics:
            raise Refusal("no such topic", 404)
        found = self._messages.newest(topic, _WAIT_S)
        if found is None:
            raise Refusal("no message yet", 404)
        return as_json({"stamp": str(found.header.stamp_ns), "message": tree_of(found)})

    def _log(self, query: BrowserQuery) -> Answer:
        return as_json({"lines": self._lines.after(query.whole("after") or 0)})

    def _diagnostics(self, _: BrowserQuery) -> Answer:
        return as_json(
            {"statuses": self._monitor.statuses(), "live": self._runtime.playback is None}
        )

    def _play(self, query: BrowserQuery) -> Answer:
        playback = self._runtime.playback
        if playback is None:
            raise Refusal("this source cannot be paused or seeked", 409)
        if "seek" in query:
            playback.seek(query.seconds("seek"))
        elif "step" in query:
            playback.step(-1 if query.text("step") == "back" else 1)
        elif "toggle" in query:
            playback.toggle()
        state = playback.state
        return as_json({"position": state.position_s, "playing": state.playing})


def _page(name: str) -> Answer:
    if name not in PAGES:
        raise Refusal(f"no such page; choose from {', '.join(PAGES)}", 404)
    return Answer(_read(f"{name}.html"), "text/html; charset=utf-8")


@cache
def _read(name: str) -> bytes:
    """A page with its icon, style and scripts inside."""
    page = (_FOLDER / name).read_text("utf-8").replace("<title>", f"{_ICON}\n<title>")
    for part in sorted(_FOLDER.glob("*.css")) + sorted(_FOLDER.glob("*.js")):
        page = page.replace(f"/* {part.name} */", part.read_text("utf-8"))
    colors = json.dumps([css(color) for color in PALETTE])
    return page.replace("/* colors.js */", f"const COLORS = {colors};").encode()
