"""A kernel made for the tests, with a webcam of its own; no device was at hand."""

from __future__ import annotations

import errno
import struct

# as a C program with linux/videodev2.h prints them on 64 bits
VIDIOC_QUERYCTRL, VIDIOC_QUERYMENU = 0xC0445624, 0xC02C5625
VIDIOC_G_CTRL, VIDIOC_S_CTRL = 0xC008561B, 0xC008561C
INTEGER, BOOLEAN, MENU, BUTTON, CLASS, MENU_OF_NUMBERS = 1, 2, 3, 4, 6, 9
BRIGHTNESS, WHITE_BALANCE, LINK = 0x00980900, 0x0098090C, 0x009F0901
EXPOSURE, FOCUS, FOCUS_AUTO, AUTO = 0x009A0902, 0x009A090A, 0x009A090C, 0x009A0901
MANUAL, APERTURE_PRIORITY = 1, 3


class Kernel:
    """Answers as a webcam's driver does, and keeps what was set, in its order."""

    def __init__(self) -> None:
        self.set: list[tuple[int, int]] = []
        self.gone = False
        self._controls = {
            0x00980001: ("User Controls", CLASS, 0, 0, 4),
            BRIGHTNESS: ("Brightness", INTEGER, -64, 64, 0),
            WHITE_BALANCE: ("White Balance, Automatic", BOOLEAN, 0, 1, 0),
            0x0098091B: ("Gamma", INTEGER, 1, 9, 1),  # disabled
            AUTO: ("Auto Exposure", MENU, 0, 3, 0),
            EXPOSURE: ("Exposure Time, Absolute", INTEGER, 1, 5000, 0x10),
            FOCUS: ("Focus, Absolute", INTEGER, 0, 1023, 0x10),
            FOCUS_AUTO: ("Focus, Automatic Continuous", BOOLEAN, 0, 1, 0),
            0x009A0920: ("Reset", BUTTON, 0, 0, 0),
            0x009A0921: ("Privacy", BOOLEAN, 0, 1, 4),  # read-only
            LINK: ("Link Frequency", MENU_OF_NUMBERS, 0, 1, 0),
        }
        self.values = {BRIGHTNESS: 5, WHITE_BALANCE: 1, AUTO: APERTURE_PRIORITY, EXPOSURE: 157}
        self.values |= {FOCUS: 10, FOCUS_AUTO: 1, LINK: 0, 0x0098091B: 1, 0x009A0921: 0}
        self._menus: dict[tuple[int, int], bytes] = {  # a webcam has but two modes of exposure
            (AUTO, MANUAL): b"Manual Mode",
            (AUTO, APERTURE_PRIORITY): b"Aperture Priority Mode",
            (LINK, 0): struct.pack("<q", 450_000_000),
            (LINK, 1): struct.pack("<q", 900_000_000),
        }

    def ioctl(self, file: int, request: int, data: bytearray) -> int:
        if self.gone:
            raise OSError(errno.ENODEV, "No such device")
        answers = {VIDIOC_QUERYCTRL: self._query, VIDIOC_QUERYMENU: self._query_menu}
        answers |= {VIDIOC_G_CTRL: self._get, VIDIOC_S_CTRL: self._set}
        if request not in answers:
            raise OSError(errno.ENOTTY, "Inappropriate ioctl for device")
        assert len(data) == request >> 16 & 0x3FFF
        answers[request](data)
        return 0

    def _query(self, data: bytearray) -> None:
        (asked,) = struct.unpack_from("<I", data)
        assert asked & 0x80000000
        later = [number for number in self._controls if number > asked & 0x7FFFFFFF]
        if not later:
            raise OSError(errno.EINVAL, "Invalid argument")
        name, kind, minimum, maximum, flags = self._controls[later[0]]
        struct.pack_into("<II", data, 0, later[0], kind)
        data[8:40] = name.encode().ljust(32, b"\0")
        struct.pack_into("<iiiiI", data, 40, minimum, maximum, 1, 0, flags)

    def _query_menu(self, data: bytearray) -> None:
        entry = self._menus.get(struct.unpack_from("<II", data))
        if entry is None:
            raise OSError(errno.EINVAL, "Invalid argument")
        data[8:40] = entry.ljust(32, b"\0")

    def _get(self, data: bytearray) -> None:
        (number,) = struct.unpack_from("<I", data)
        struct.pack_into("<i", data, 4, self.values[number])

    def _set(self, data: bytearray) -> None:
        number, value = struct.unpack("<Ii", data)
        automatic = number == EXPOSURE and self.values[AUTO] != MANUAL
        if automatic or (number == FOCUS and self.values[FOCUS_AUTO]):
            raise OSError(errno.EACCES, "Permission denied")
        self.values[number] = value
        self.set.append((number, value))
