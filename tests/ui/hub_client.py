"""A browser's side of one of the page's WebSockets, without a server between."""

import asyncio
import json
import struct
from queue import Queue

import numpy as np

from ros_visualise.ui.server.gate import Visit
from ros_visualise.ui.server.host import page_loop

PATIENCE_S = 60.0


def unpacked(data):
    """A message in binary: what its header says, and ``rows``."""
    (length,) = struct.unpack_from("<I", data)
    header = json.loads(data[4 : 4 + length])
    rows = np.frombuffer(data, "<f8", offset=4 + length).reshape(-1, header["width"])
    return {**header, "rows": rows}


class HubClient:
    """Sends a hub what a test wants, and keeps what comes until it is read."""

    def __init__(self, hub, is_viewer=False):
        self._loop = page_loop()
        self._sent, self.got = asyncio.Queue(), Queue()
        self._put({"type": "websocket.connect"})
        scope = {"state": {"visit": Visit(is_viewer, False, lambda size: None)}}
        serving = hub.serve(scope, self._sent.get, self._take)
        self._serving = asyncio.run_coroutine_threadsafe(serving, self._loop)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._put({"type": "websocket.disconnect"})
        self._serving.result(PATIENCE_S)

    def send(self, message=None, **parts):
        text = message if isinstance(message, str) else json.dumps(message or parts)
        self._put({"type": "websocket.receive", "text": text})

    def read(self):
        """The next message."""
        message = self.got.get(timeout=PATIENCE_S)
        if message.get("bytes") is not None:
            return unpacked(message["bytes"])
        return json.loads(message["text"])

    def read_until(self, check):
        """The first message that passes, of those to come."""
        while not check(message := self.read()):
            pass
        return message

    def _put(self, message):
        self._loop.call_soon_threadsafe(self._sent.put_nowait, message)

    async def _take(self, message):
        if message["type"] == "websocket.send":
            self.got.put(message)
