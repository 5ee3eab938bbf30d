"""Local sets of MISB ST 0601, as metadata of unmanned aircraft come in films.

Each begins with a universal key of 16 bytes; its items are a tag (BER-OID), a length (BER) and a
value; the last one is a checksum over all before it.

Source: MISB ST 0601.19 (items and their ranges), ST 0107.5 (tags and lengths), ST 1201.5 (IMAPB).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

KEY = bytes.fromhex("060e2b34020b01010e01030101000000")
_CHECKSUM, _CHECKED_TO = 1, 2  # its tag; its own bytes are not summed up
_LONGEST = 1 << 16  # of a set
_ALTITUDE, _FULL_TURN, _PRESSURE = (-900.0, 19_000.0), (0.0, 360.0), (0.0, 5000.0)

KlvValue = float | str


class _KlvItem(NamedTuple):
    name: str
    read: Callable[[bytes], KlvValue]


def _unsigned(low: float, high: float) -> Callable[[bytes], KlvValue]:
    """Linear from 0 and the largest number of its bytes."""
    return lambda b: low + int.from_bytes(b, "big") * (high - low) / (256 ** len(b) - 1)


def _signed(high: float) -> Callable[[bytes], KlvValue]:
    """Linear and symmetric; the smallest number means "out of range"."""

    def read(value: bytes) -> float:
        most = 256 ** len(value) // 2
        number = int.from_bytes(value, "big", signed=True)
        return math.nan if number == -most else number * high / (most - 1)

    return read


def _mapped(low: float, high: float) -> Callable[[bytes], KlvValue]:
    """IMAPB of any length; numbers whose first bit is set are special values."""

    def read(value: bytes) -> float:
        number, bits = int.from_bytes(value, "big"), 8 * len(value) - 1
        if number > 1 << bits:
            return math.nan
        step = 2.0 ** (math.ceil(math.log2(high - low)) - bits)
        offset = (low / step) % 1 if low < 0 < high else 0.0
        return step * (number - offset) + low

    return read


def _number(value: bytes) -> float:
    return float(int.from_bytes(value, "big"))


def _integer(value: bytes) -> float:
    return float(int.from_bytes(value, "big", signed=True))


def _text(value: bytes) -> str:
    return value.decode("utf-8", "replace").rstrip("\0")


_LATITUDE, _LONGITUDE, _SMALL = _signed(90), _signed(180), _signed(0.075)
_ITEMS = {
    2: _KlvItem("precision_time_stamp", _number),
    3: _KlvItem("mission_id", _text),
    4: _KlvItem("platform_tail_number", _text),
    5: _KlvItem("platform_heading", _unsigned(*_FULL_TURN)),
    6: _KlvItem("platform_pitch", _signed(20)),
    7: _KlvItem("platform_roll", _signed(50)),
    8: _KlvItem("platform_true_airspeed", _number),
    9: _KlvItem("platform_indicated_airspeed", _number),
    10: _KlvItem("platform_designation", _text),
    11: _KlvItem("image_source_sensor", _text),
    12: _KlvItem("image_coordinate_system", _text),
    13: _KlvItem("sensor_latitude", _LATITUDE),
    14: _KlvItem("sensor_longitude", _LONGITUDE),
    15: _KlvItem("sensor_altitude", _unsigned(*_ALTITUDE)),
    16: _KlvItem("sensor_horizontal_fov", _unsigned(0, 180)),
    17: _KlvItem("sensor_vertical_fov", _unsigned(0, 180)),
    18: _KlvItem("sensor_relative_azimuth", _unsigned(*_FULL_TURN)),
    19: _KlvItem("sensor_relative_elevation", _signed(180)),
    20: _KlvItem("sensor_relative_roll", _unsigned(*_FULL_TURN)),
    21: _KlvItem("slant_range", _unsigned(0, 5_000_000)),
    22: _KlvItem("target_width", _unsigned(0, 10_000)),
    23: _KlvItem("frame_center_latitude", _LATITUDE),
    24: _KlvItem("frame_center_longitude", _LONGITUDE),
    25: _KlvItem("frame_center_elevation", _unsigned(*_ALTITUDE)),
    **{
        26 + 2 * n + k: _KlvItem(f"offset_corner_{axis}_{n + 1}", _SMALL)
        for n in range(4)
        for k, axis in enumerate(("latitude", "longitude"))
    },
    34: _KlvItem("icing_detected", _number),
    35: _KlvItem("wind_direction", _unsigned(*_FULL_TURN)),
    36: _KlvItem("wind_speed", _unsigned(0, 100)),
    37: _KlvItem("static_pressure", _unsigned(*_PRESSURE)),
    38: _KlvItem("density_altitude", _unsigned(*_ALTITUDE)),
    39: _KlvItem("outside_air_temperature", _integer),
    40: _KlvItem("target_latitude", _LATITUDE),
    41: _KlvItem("target_longitude", _LONGITUDE),
    42: _KlvItem("target_elevation", _unsigned(*_ALTITUDE)),
    43: _KlvItem("target_gate_width", lambda b: 2 * _number(b)),
    44: _KlvItem("target_gate_height", lambda b: 2 * _number(b)),
    45: _KlvItem("target_error_ce90", _unsigned(0, 4095)),
    46: _KlvItem("target_error_le90", _unsigned(0, 4095)),
    47: _KlvItem("generic_flag", _number),
    49: _KlvItem("differential_pressure", _unsigned(*_PRESSURE)),
    50: _KlvItem("platform_angle_of_attack", _signed(20)),
    51: _KlvItem("platform_vertical_speed", _signed(180)),
    52: _KlvItem("platform_sideslip", _signed(20)),
    53: _KlvItem("airfield_pressure", _unsigned(*_PRESSURE)),
    54: _KlvItem("airfield_elevation", _unsigned(*_ALTITUDE)),
    55: _KlvItem("relative_humidity", _unsigned(0, 100)),
    56: _KlvItem("platform_ground_speed", _number),
    57: _KlvItem("ground_range", _unsigned(0, 5_000_000)),
    58: _KlvItem("platform_fuel_remaining", _unsigned(0, 10_000)),
    59: _KlvItem("platform_call_sign", _text),
    64: _KlvItem("platform_magnetic_heading", _unsigned(*_FULL_TURN)),
    65: _KlvItem("version", _number),
    75: _KlvItem("sensor_ellipsoid_height", _unsigned(*_ALTITUDE)),
    78: _KlvItem("frame_center_ellipsoid_height", _unsigned(*_ALTITUDE)),
    79: _KlvItem("sensor_north_velocity", _signed(327)),
    80: _KlvItem("sensor_east_velocity", _signed(327)),
    **{
        82 + 2 * n + k: _KlvItem(f"corner_{axis}_{n + 1}", read)
        for n in range(4)
        for k, (axis, read) in enumerate((("latitude", _LATITUDE), ("longitude", _LONGITUDE)))
    },
    90: _KlvItem("platform_pitch_full", _signed(90)),
    91: _KlvItem("platform_roll_full", _signed(90)),
    92: _KlvItem("platform_angle_of_attack_full", _signed(90)),
    93: _KlvItem("platform_sideslip_full", _signed(180)),
    96: _KlvItem("target_width_extended", _mapped(0, 1_500_000)),
    103: _KlvItem("density_altitude_extended", _mapped(-900, 40_000)),
    104: _KlvItem("sensor_ellipsoid_height_extended", _mapped(-900, 40_000)),
}
"""Tag -> its item; others are skipped."""


class KlvStream:
    """Reads the sets in a stream of bytes; any part of it may be damaged or missing.

    Attributes:
        damaged: number of sets with a wrong checksum or length, or without a checksum.
    """

    def __init__(self) -> None:
        self.damaged = 0
        self._rest = b""

    def feed(self, data: bytes) -> Iterator[dict[str, KlvValue]]:
        """The values, by name, of each set that these bytes complete."""
        self._rest += data
        while (start := self._rest.find(KEY)) >= 0:
            end = _end_of(self._rest, start)
            if end is not None and end > len(self._rest) and end - start <= _LONGEST:
                self._rest = self._rest[start:]
                if KEY not in self._rest[1:]:
                    return  # the rest comes later
                end = None
                start = 0
            values = None if end is None else read_set(self._rest[start:end])
            self.damaged += values is None
            if values is not None:
                yield values
            self._rest = self._rest[start + len(KEY) if values is None or end is None else end :]
        self._rest = self._rest[1 - len(KEY) :]

    def finish(self) -> None:
        """Count a set that is cut off."""
        self.damaged += self._rest.startswith(KEY)


def read_set(data: bytes) -> dict[str, KlvValue] | None:
    """The known values of a whole set; None if its checksum or a length is wrong."""
    length = _ber(data, len(KEY))
    if length is None:
        return None
    place, found, is_checked = length[1], {}, False
    while place < len(data):
        tag = _oid(data, place)
        size = None if tag is None else _ber(data, tag[1])
        if tag is None or size is None or size[1] + size[0] > len(data):
            return None
        value = data[size[1] : size[1] + size[0]]
        place = size[1] + size[0]
        if tag[0] == _CHECKSUM:
            is_checked = place == len(data) and value == _sum(data[:-_CHECKED_TO])
        elif tag[0] in _ITEMS and value:
            item = _ITEMS[tag[0]]
            found[item.name] = item.read(value)
    return found if is_checked else None


def _end_of(data: bytes, start: int) -> int | None:
    """End of the set that begins there, by its length; None if that is wrong."""
    if len(data) < start + len(KEY) + 5:
        return len(data) + 1  # to be seen
    length = _ber(data, start + len(KEY))
    return None if length is None else length[1] + length[0]


def _ber(data: bytes, place: int) -> tuple[int, int] | None:
    """A length, and the place behind it; None if it is cut off or unlimited."""
    if place >= len(data):
        return None
    first = data[place]
    if first < 128:
        return first, place + 1
    end = place + 1 + (first & 127)
    if not 1 <= first & 127 <= 4 or end > len(data):
        return None
    return int.from_bytes(data[place + 1 : end], "big"), end


def _oid(data: bytes, place: int) -> tuple[int, int] | None:
    """A tag, and the place behind it; None if it is cut off or too long."""
    tag = 0
    for end, byte in enumerate(data[place : place + 3], place + 1):
        tag = tag << 7 | byte & 127
        if byte < 128:
            return tag, end
    return None


def _sum(data: bytes) -> bytes:
    """The checksum: 16-bit words summed up."""
    total = 256 * sum(data[::2]) + sum(data[1::2])
    return (total & 0xFFFF).to_bytes(2, "big")
