"""Runs a command where nothing but this machine can be reached, and looks at its page.

To be run in a network of its own. Exits as the command does, or with 99 if its page showed nothing.
"""

from __future__ import annotations

import fcntl
import os
import socket
import struct
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

from websockets.exceptions import WebSocketException

sys.path.insert(0, str(Path(__file__).parent / "ui"))
from page_client import TOKEN, Client

_SET_FLAGS, _UP = 0x8914, 1  # SIOCSIFFLAGS, IFF_UP of Linux
_PORT, _UNSEEN, _LONG_S = 8080, 99, 1e6


def main() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        fcntl.ioctl(any_socket, _SET_FLAGS, struct.pack("16sh14x", b"lo", _UP))
    process = subprocess.Popen(sys.argv[1:], env=os.environ | {"ROS_VISUALISE_TOKEN": TOKEN})
    images = 0
    while process.poll() is None:
        try:
            images = max(images, _visit(process))
        except OSError:  # it is not there yet
            time.sleep(0.1)
    return process.returncode or (0 if images else _UNSEEN)


def _visit(process: subprocess.Popen[bytes]) -> int:
    """Look at the page until it ends; how many images it showed."""
    client = Client(_PORT)
    with suppress(WebSocketException):
        client.read_until(lambda: process.poll() is not None, timeout_s=_LONG_S)
    return len(client.images)


if __name__ == "__main__":
    sys.exit(main())
