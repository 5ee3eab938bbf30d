"""Times of frames, from the files of times; missing times are filled in."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from statistics import median

import numpy as np
import numpy.typing as npt

from ros_visualise.sources.kitti.files import read_lines
from ros_visualise.sources.series import DamagedFile

Times = dict[int, int]
"""Number of a frame -> nanoseconds since 1970, with KITTI's local time taken for UTC."""

_NS = 1_000_000_000
_LINE = re.compile(r"(\d{4}-\d\d-\d\d)[ T](\d\d:\d\d:\d\d(\.\d+)?)")
_LAST_NS = 2**32 * _NS  # the latest stamp of ROS 1


class FrameTimes:
    """The times of one sensor's frames.

    Args:
        name: folder of the sensor.
        path: file of its times, which may be missing.
        lines: the time on each line of that file; None on those without one.
        numbers: numbers of its frames.

    Attributes:
        times: of the frames whose time is known.
        more: number of times of missing frames.
    """

    def __init__(
        self, name: str, path: Path, lines: Sequence[int | None], numbers: Sequence[int]
    ) -> None:
        self.name, self.path, self.numbers = name, path, numbers
        # A line belongs to the frame of its own number, counted from 0; of a part of a drive whose
        # list was cut with it, the first line belongs to the first frame.
        is_part = bool(numbers) and numbers[-1] >= len(lines) > numbers[-1] - numbers[0]
        first = numbers[0] if is_part else 0
        known = {first + line: time for line, time in enumerate(lines) if time is not None}
        self.times: Times = {number: known[number] for number in numbers if number in known}
        self.more = len(known) - len(self.times)

    @property
    def lacking(self) -> list[int]:
        """The numbers of the frames without a time."""
        return [number for number in self.numbers if number not in self.times]

    @property
    def gaps(self) -> str:
        """Number of lacking times, in words."""
        return f"{len(self.lacking)} of {len(self.numbers)} times are missing or damaged"


def read_times(path: Path, parse: Callable[[str], int | None]) -> list[int | None]:
    """The time on each line of a file in ns, None on those without one; of no file, nothing."""
    try:
        return [parse(line) for line in read_lines(path)]
    except DamagedFile:
        return []


def parse_time(line: str) -> int | None:
    """``2011-09-26 13:08:24.973999360`` as ns since 1970, whatever the local time zone."""
    found = _LINE.fullmatch(line.strip())
    if found is None:
        return None
    try:
        stamp_ns = int(np.datetime64(f"{found[1]}T{found[2][:18]}", "ns").astype(np.int64))
    except ValueError:  # such as month 13
        return None
    return stamp_ns if 0 <= stamp_ns < _LAST_NS else None


def read_stamps(name: str, path: Path, numbers: Sequence[int]) -> FrameTimes:
    """The times of frames from a ``timestamps.txt``, which may be missing."""
    return FrameTimes(name, path, read_times(path, parse_time), numbers)


def complete(
    sensors: Sequence[FrameTimes],
    notes: list[str],
    synced: bool,
    start_ns: int,
    periods_ns: Mapping[str, int],
) -> tuple[dict[str, npt.NDArray[np.int64]], list[DamagedFile]]:
    """The stamps of all frames by sensor, and the files that lack some.

    Times that are missing are those of another sensor's frame of the same number (of a synced
    drive, where equal numbers are one turn of the scanner); else they are counted on from the
    nearest that is known, at the sensor's rate; else from ``start_ns``.

    Args:
        sensors: in the order in which the others are asked; their ``times`` are completed.
        notes: gets a note on each sensor without a file of times.
        periods_ns: by the sensors' names.
    """
    damaged = []
    known = {one.name: dict(one.times) for one in sensors}
    for one in sensors:
        if not one.lacking:
            continue
        gaps = one.gaps
        sources = _borrow(one, known) if synced else []
        if one.lacking:
            sources.append(_count(one, known, synced, start_ns, periods_ns[one.name]))
        stamped = f"frames without a time are stamped {', '.join(sources)}"
        if one.path.exists():
            damaged.append(DamagedFile(one.path, f"{gaps}; {stamped}"))
        else:
            notes.append(f"{one.name}: no times, as {one.path.name} is missing; {stamped}")
    found = {one.name: [one.times[number] for number in one.numbers] for one in sensors}
    return {name: np.array(times, np.int64) for name, times in found.items()}, damaged


def _borrow(one: FrameTimes, known: Mapping[str, Times]) -> list[str]:
    sources = []
    for name, times in known.items():
        given = {number: times[number] for number in one.lacking if number in times}
        if given:
            one.times.update(given)
            sources.append(f"like the frames of {name} with the same numbers")
    return sources


def _count(
    one: FrameTimes, known: Mapping[str, Times], synced: bool, start_ns: int, period_ns: int
) -> str:
    basis = dict(one.times)
    if not basis:
        others = [times for times in known.values() if times]
        if others and synced:
            basis = dict(others[0])
        else:
            begin_ns = min((min(times.values()) for times in others), default=start_ns)
            basis = {one.numbers[0]: begin_ns}
    period_ns = _period(basis) or period_ns
    numbers = np.array(sorted(basis))
    for number in one.lacking:
        nearest = int(numbers[np.abs(numbers - number).argmin()])
        one.times[number] = max(0, basis[nearest] + (number - nearest) * period_ns)
    begin = np.datetime64(min(basis.values()), "ns")
    return f"at {_NS / period_ns:.3g} Hz from {str(begin)[:19].replace('T', ' ')} onwards"


def _period(times: Times) -> int:
    numbers = sorted(times)
    gaps = [(times[b] - times[a]) / (b - a) for a, b in pairwise(numbers)]
    return round(median(gaps)) if gaps and median(gaps) > 0 else 0
