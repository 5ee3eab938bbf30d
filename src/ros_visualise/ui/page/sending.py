"""Sends answers to browsers, at the speed of each."""

from __future__ import annotations

import asyncio
from http import HTTPStatus

from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Response

from ros_visualise.ui.look.answers import Answer

STALL_S = 30.0
"""A browser that accepts no data for so long is disconnected."""
_PIECE_BYTES = 256 << 10


class Stalled(Exception):
    """An answer was not accepted to its end; the text is empty if the connection was lost."""


async def send(
    connection: ServerConnection, answer: Answer, headers: Headers, stall_s: float = STALL_S
) -> None:
    """Send an answer, and return when all of it is on its way; raises `Stalled` if it is not."""
    connection.transport.set_write_buffer_limits(0)  # so that `drain` waits until all is accepted
    await _give(connection, _head(answer, headers), stall_s)
    body = memoryview(answer.body)
    for start in range(0, len(body), _PIECE_BYTES):
        await _give(connection, body[start : start + _PIECE_BYTES], stall_s)


async def _give(connection: ServerConnection, piece: bytes | memoryview, stall_s: float) -> None:
    transport = connection.transport
    transport.write(piece)
    taking = asyncio.ensure_future(connection.drain())
    try:
        while True:
            waiting = transport.get_write_buffer_size()
            await asyncio.wait([taking], timeout=stall_s)
            if taking.done():
                break
            if transport.get_write_buffer_size() == waiting:
                raise Stalled(f"a browser accepted no data for {stall_s:g} s; connection closed")
    finally:
        taking.cancel()
    if transport.is_closing() or taking.exception() is not None:
        raise Stalled


def _head(answer: Answer, headers: Headers) -> bytes:
    status = HTTPStatus(answer.status)
    all_of_them = Headers(
        {
            "Connection": "close",
            "Content-Type": answer.type,
            "Content-Length": str(len(answer.body)),
            "Cache-Control": "no-store",
            **headers,
        }
    )
    all_of_them.update(answer.headers)
    return Response(status.value, status.phrase, all_of_them, b"").serialize()
