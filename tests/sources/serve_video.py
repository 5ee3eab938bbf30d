"""Serves FFmpeg's test picture, live, as MPEG-TS to one taker: ``serve_video.py URL``."""

import socket
import sys
import time
from typing import Any
from urllib.parse import urlsplit

import av


def target_of(url: str) -> Any:
    """Where to write for that URL: the UDP address itself, or the answer to an HTTP request."""
    address = urlsplit(url)
    if address.scheme == "udp":
        return f"{url}?pkt_size=1316"
    with socket.create_server((address.hostname, address.port)) as server:
        connection, _ = server.accept()
    connection.recv(65536)
    connection.sendall(b"HTTP/1.0 200 OK\r\nContent-Type: video/mp2t\r\n\r\n")
    return connection.makefile("wb", buffering=0)


def serve(url: str) -> None:
    """Until the taker goes or the process is killed."""
    target = target_of(url)
    picture = av.open("testsrc2=size=160x120:rate=30", format="lavfi")
    with av.open(target, "w", format="mpegts") as container:
        stream: Any = container.add_stream("mpeg2video", rate=30, options={"g": "5"})
        stream.width, stream.height, stream.pix_fmt = 160, 120, "yuv420p"
        start = time.monotonic()
        for number, frame in enumerate(picture.decode(video=0)):
            time.sleep(max(0, start + number / 30 - time.monotonic()))
            container.mux(stream.encode(frame))


if __name__ == "__main__":
    serve(sys.argv[1])
