"""What a browser may send to the page: messages on its connection, and questions."""

import contextlib
import json
import logging
import os
from collections.abc import Iterator
from functools import cache
from http.client import HTTPConnection
from pathlib import Path
from urllib.parse import quote

from ports import free_port
from ui.page_client import TOKEN
from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.playback import Playback
from ros_visualise.ui import ViewOptions
from ros_visualise.ui.page import Page

_MESSAGES = {
    "/live/nodes": [
        {"do": "set", "values": {"filters": {"threshold": 90}}, "number": 1},
        {"do": "act", "node": "filters", "action": "reset"},
        {"do": "restore", "values": {"filters/threshold": "90"}, "number": 2},
        {"do": "read", "topics": ["/edges"]},
    ],
    "/live/robot": [{"do": "hold", "press": "a", "names": ["forward"], "speed": 1, "turn": 0.5}],
    "/live/files": [{"do": "open", "name": "nothing.mp4"}],
    "/live/images": [
        {"show": {"a": {"topic": "/edges", "size": 100}}},
        {"ask": 1, "key": "a", "what": "pixels", "at": [0, 0]},
    ],
    "/live/clock": [{"seek": 0.5}, {"mark": [0.5, "here"]}, {"range": [0, 1]}],
    "/live/space": [
        {"pick": {"ray": [0, 0, 0, 0, 0, 1], "id": 1}},
        {"set": {"3d/appearance/axes size": 2}},
        {"view": [1, 2, 3, 4, 5, 6]},
    ],
    "/live/plots": [
        {"number": 1, "views": [{"curve": "/edges:width"}], "from": 0, "to": 1, "columns": 80},
        {"csv": ["/edges:width"], "from": 0, "to": 1},
        {"at": 0.5, "curves": ["/edges:width"]},
    ],
    "/live/messages": [{"topic": "/edges"}],
}
_PATHS = list(_MESSAGES)
_QUESTIONS = (
    "ask=ticks",
    "ask=graph",
    "ask=frames",
    "ask=recorded&name=a.mcap&from=5",
)


def whole_messages(folder: Path) -> list[Path]:
    """A file for each message and question."""
    files = {
        f"{_PATHS.index(path)}-{n}.msg": json.dumps(one).encode()
        for path, messages in _MESSAGES.items()
        for n, one in enumerate(messages)
    }
    files |= {f"{n}.question": one.encode() for n, one in enumerate(_QUESTIONS)}
    for name, data in files.items():
        (folder / name).write_bytes(data)
    return [folder / name for name in files]


def send(path: Path) -> list[str]:
    """Send what a file holds to a page; what is wrong with it then."""
    shown = _Shown.of_this_process()
    if path.suffix == ".msg":
        with contextlib.suppress(WebSocketException, OSError):  # it may hang up
            live = _PATHS[int(path.name.partition("-")[0])]
            with connect(f"ws://127.0.0.1:{shown.port}/{TOKEN}{live}") as socket:
                socket.send(path.read_bytes().decode(errors="replace"))
                socket.ping().wait(20)
    else:
        shown.ask(quote(path.read_bytes(), safe="=&/"))
    faults = [] if shown.ask("ask=graph") == 200 else ["it no longer answers"]
    return faults + list(shown.take_faults())


class _Shown(logging.Handler):
    """A page of this process; hears what breaks in it."""

    @staticmethod
    @cache
    def of_this_process() -> "_Shown":
        """The one page that all mutants are sent to."""
        return _Shown()

    def __init__(self) -> None:
        super().__init__()
        os.environ["ROS_VISUALISE_TOKEN"] = TOKEN
        self.port = free_port()
        self._faults: list[str] = []
        logging.getLogger().addHandler(self)
        playback = Playback(hold=True)
        playback.pause()
        runtime = LocalRuntime(image_pipeline("landscape"), playback)
        runtime.start()
        self._page = Page(ViewOptions(port=self.port))
        self._page.open(runtime)

    def emit(self, record: logging.LogRecord) -> None:
        """Keep what is a bug."""
        if record.exc_info:
            self._faults.append(f"{record.getMessage()}: {record.exc_info[1]!r}")

    def ask(self, query: str) -> int:
        """The status of the answer; 0 where there is none."""
        with contextlib.closing(HTTPConnection("127.0.0.1", self.port, timeout=60)) as asked:
            try:
                asked.request("GET", f"/{TOKEN}/?{query}", headers={"X-Ros-Visualise": "1"})
                return asked.getresponse().status
            except OSError:
                return 0

    def take_faults(self) -> Iterator[str]:
        """What broke since it was asked for last."""
        while self._faults:
            yield self._faults.pop(0)
