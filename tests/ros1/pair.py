"""The two ends of a connection between a publisher and a subscriber, in one process."""

import socket
from pathlib import Path

import numpy as np
from rospy.impl.tcpros_base import TCPROSTransport
from rospy.impl.tcpros_pubsub import TCPROSPub
from sensor_msgs.msg import Image

from ros_visualise.runtime.ros1.outbox import Outbox
from ros_visualise.runtime.ros1.receiver import Stream
from ros_visualise.runtime.ros1.wire import decode, encode

SIZE = 1_000_000


class Pair:
    """An outbox, and what its subscriber reads."""

    def __init__(self) -> None:
        with socket.create_server(("127.0.0.1", 0)) as server:
            self.there = socket.create_connection(server.getsockname())
            here, _ = server.accept()
        self.there.settimeout(60)
        self.connection = TCPROSTransport(TCPROSPub("/images", Image), "/images")
        self.connection.set_socket(here, "/viewer")
        self.outbox = Outbox(self.connection)
        self.stream = Stream(self.there)

    def offer(self, number: int, size: int = SIZE) -> bool:
        return self.outbox.offer(encode(Image(data=np.full(size, number, np.uint8)), number))

    def take(self) -> Image:
        """The next message, which is whole."""
        message = decode(self.stream.receive(), Image)
        assert (message.data == message.header.seq).all()
        return message

    def read(self) -> int:
        """The number of the next message."""
        return int(self.take().header.seq)

    def meet(self, size: int = SIZE) -> None:
        """Exchange messages until those that are large come in memory."""
        for number in (1, 2, 3):
            self.offer(number, size)
            assert self.read() == number
        assert lent() > 0

    def close(self) -> None:
        self.connection.close()
        self.stream.close()
        self.there.close()


def lent(process: int | str = "self") -> int:
    """How much memory a process has mapped that it lends or borrows, in bytes."""
    lines = Path(f"/proc/{process}/maps").read_text().splitlines()
    ranges = [line.split()[0].split("-") for line in lines if "memfd:ros_visualise" in line]
    return sum(int(end, 16) - int(start, 16) for start, end in ranges)
