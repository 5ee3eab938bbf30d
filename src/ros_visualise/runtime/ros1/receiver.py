"""What reads a connection to a publisher in rospy's place."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

import genpy
from rospy.exceptions import TransportTerminated

from ros_visualise.runtime.ros1.stream import BrokenStream, Stream
from ros_visualise.runtime.ros1.wire import decode

log = logging.getLogger(__name__)


class Receiver:
    """Takes the place of ``receive_once`` of a TCPROSTransport.

    Args:
        connection: not yet open.
        message_class: of genpy.
        refuse: is told why what came is no message.
    """

    def __init__(self, connection: Any, message_class: Any, refuse: Callable[[str], None]) -> None:
        self._connection = connection
        self._class = message_class
        self._refuse = refuse
        self._stream: Stream | None = None

    def __call__(self) -> list[Any]:
        """The next message; none where what came was not one.

        Raises:
            TransportTerminated: there will be no more.
        """
        connection = self._connection
        if self._stream is None:  # what rospy has read together with the handshake comes first
            self._stream = Stream(connection.socket, connection.read_buff.getvalue())
        try:
            body = self._stream.receive()
            message = decode(body, self._class)
        except genpy.DeserializationError as error:
            self._refuse(f"not a message: {error}")
            return []
        except BrokenStream as error:
            log.warning(
                "%s: %s; closing connection to %s", connection.name, error, connection.endpoint_id
            )
            raise TransportTerminated(str(error)) from error
        except (EOFError, OSError) as error:
            raise TransportTerminated("the publisher has gone") from error
        message._connection_header = connection.header
        connection.stat_bytes += body.nbytes + 4
        connection.stat_num_msg += 1
        if connection.is_latched:
            connection.latch = message
        return [message]

    def close(self) -> None:
        """Let go of what belongs to the connection."""
        if self._stream is not None:
            self._stream.close()
