"""Controls of V4L2 devices, against a kernel made for the tests; no device was at hand."""

import errno
import struct

import pytest

from ros_visualise.errors import OpenError
from ros_visualise.sources.v4l2_controls import apply_controls, parse_controls

# as a C program with linux/videodev2.h prints them on 64 bits
VIDIOC_QUERYCTRL, VIDIOC_S_CTRL = 0xC0445624, 0xC008561C
INTEGER, BOOLEAN, MENU, BUTTON, CLASS = 1, 2, 3, 4, 6


class Kernel:
    """Answers as a webcam's driver does, and keeps what was set."""

    def __init__(self) -> None:
        self.set: list[tuple[int, int]] = []
        self.manual = False
        self._controls = {
            0x00980001: ("User Controls", CLASS, 0, 0, 4),
            0x00980900: ("Brightness", INTEGER, -64, 64, 0),
            0x0098090C: ("White Balance, Automatic", BOOLEAN, 0, 1, 0),
            0x0098091B: ("Gamma", INTEGER, 1, 9, 1),  # disabled
            0x009A0901: ("Auto Exposure", MENU, 0, 3, 0),
            0x009A0902: ("Exposure Time, Absolute", INTEGER, 1, 5000, 0x10),
            0x009A0920: ("Reset", BUTTON, 0, 0, 0),
            0x009A0921: ("Privacy", BOOLEAN, 0, 1, 4),  # read-only
        }

    def ioctl(self, file: int, request: int, data: bytearray) -> int:
        if request == VIDIOC_QUERYCTRL:
            self._query(data)
        elif request == VIDIOC_S_CTRL:
            assert len(data) == 8
            number, value = struct.unpack("<Ii", data)
            if number == 0x009A0901:
                self.manual = value == 1
            if number == 0x009A0902 and not self.manual:
                raise OSError(errno.EACCES, "Permission denied")
            self.set.append((number, value))
        else:
            raise OSError(errno.ENOTTY, "Inappropriate ioctl for device")
        return 0

    def _query(self, data: bytearray) -> None:
        assert len(data) == 68
        (asked,) = struct.unpack_from("<I", data)
        assert asked & 0x80000000
        later = [number for number in self._controls if number > asked & 0x7FFFFFFF]
        if not later:
            raise OSError(errno.EINVAL, "Invalid argument")
        name, kind, minimum, maximum, flags = self._controls[later[0]]
        struct.pack_into("<II", data, 0, later[0], kind)
        data[8:40] = name.encode().ljust(32, b"\0")
        struct.pack_into("<iiiiI", data, 40, minimum, maximum, 1, 0, flags)


@pytest.fixture
def kernel() -> Kernel:
    return Kernel()


def apply(text: str, kernel: Kernel) -> None:
    apply_controls("/dev/null", parse_controls(text), kernel.ioctl)


def test_controls_are_set_by_their_names_in_their_order(kernel):
    apply("brightness=-10, auto_exposure=1,exposure_time_absolute=200", kernel)
    assert kernel.set == [(0x00980900, -10), (0x009A0901, 1), (0x009A0902, 200)]


def test_nothing_asked_for_touches_nothing(kernel):
    apply("", kernel)
    apply_controls("/dev/none", {}, kernel.ioctl)
    assert kernel.set == []


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("focus=3", "no control 'focus'; there is brightness, white_balance_automatic, auto_exp"),
        ("gamma=3", "no control 'gamma'"),
        ("reset=1", "no control 'reset'"),
        ("privacy=1", "no control 'privacy'"),
        ("brightness=65", "/dev/null: brightness=65: must be from -64 to 64"),
        ("exposure_time_absolute=9", "=9: Permission denied; switch off first what sets it by it"),
        ("brightness", "controls=brightness: give NAME=NUMBER,... as `v4l2-ctl -l` lists them"),
        ("brightness=high", "give NAME=NUMBER"),
    ],
)
def test_what_the_device_does_not_take_is_refused_in_one_line(text, expected, kernel):
    with pytest.raises(OpenError, match=expected):
        apply(text, kernel)
    assert kernel.set == []


def test_a_device_that_is_none_is_refused():
    with pytest.raises(OpenError, match=r"/dev/none: No such file.*; its controls cannot be set"):
        apply_controls("/dev/none", {"brightness": 1})
    with pytest.raises(OpenError, match="no control 'brightness'; there is none"):
        apply_controls("/dev/null", {"brightness": 1})
