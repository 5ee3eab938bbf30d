"""Paths are written as the library writes them, byte for byte."""

import numpy as np
import pytest

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.data import Header, Path
from ros_visualise.messages import to_message
from ros_visualise.messages.definitions import Definitions
from ros_visualise.sinks.encoding import Encoder


def path(count: int, frame_id: str) -> Path:
    random = np.random.default_rng(count)
    stamps_ns = random.integers(0, 2**31 * 10**9, count)
    poses = random.normal(size=(count, 3)), random.normal(size=(count, 4))
    return Path(stamps_ns, *poses, Header(5_000_000_007, frame_id))


@pytest.mark.parametrize("encoding", ["ros1", "cdr"])
@pytest.mark.parametrize("frame_id", ["", "m", "map", "odom", "odom_", "kamera_ä", "a" * 40])
@pytest.mark.parametrize("count", [0, 1, 2, 500])
def test_bytes_are_those_of_the_library(encoding, frame_id, count):
    way, own = path(count, frame_id), Definitions(encoding)
    expected = own.write(Path.type_name, to_message(way, own.types))
    assert bytes(Encoder(encoding).encode(way)) == bytes(expected)


def test_a_stamp_that_ros_cannot_hold_is_refused():
    way = Path([2**31 * 10**9], np.zeros((1, 3)), np.ones((1, 4)), Header(1, "map"))
    with pytest.raises(DamagedMessage, match="between 1970 and 2038"):
        Encoder("cdr").encode(way)
