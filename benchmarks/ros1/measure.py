"""What is measured of images that come out of a node: rate, processor time, age and losses."""

import os
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from tcpros import Head, NothingComes, Tap

_TICK_S = 1 / os.sysconf("SC_CLK_TCK")


@dataclass(frozen=True)
class Window:
    """How long is measured, after how long a warm-up."""

    seconds: float = 5.0
    warmup_s: float = 1.5


@dataclass(frozen=True)
class Figures:
    """Of one window. What does not apply is NaN.

    ``cpu_ms`` is the processor time of all threads of the measured processes for each image that
    arrived, ``lost`` the share of the source's images that did not, ``white`` that of white pixels.
    """

    fps: float = 0.0
    cpu_ms: float = float("nan")
    p50_ms: float = float("nan")
    p99_ms: float = float("nan")
    lost: float = float("nan")
    white: float = float("nan")
    encoding: str = "nothing came"

    @classmethod
    def median(cls, rounds: Sequence["Figures"]) -> "Figures":
        """The median of each figure over several rounds."""
        names = ("fps", "cpu_ms", "p50_ms", "p99_ms", "lost", "white")
        values = {n: statistics.median(getattr(one, n) for one in rounds) for n in names}
        return cls(**values, encoding=rounds[-1].encoding)


def measure(
    topic: str,
    pids: Sequence[int],
    window: Window,
    sent: Callable[[int, int], int] | None = None,
    stamp_of: Callable[[Head], int] = lambda head: head.stamp_ns,
) -> Figures:
    """Listen to images for a while.

    Args:
        topic: to listen to.
        pids: processes whose time is counted.
        window: how long.
        sent: how many images the source sent with stamps from one to another, both included.
        stamp_of: how the time is read at which the source let an image go; 0 where it is unknown.
    """
    try:
        with Tap(topic) as tap:
            first, pixels = tap.next_pixels()
            _until(tap, window.warmup_s)
            cpu_s = processor_s(pids)
            heads = _until(tap, window.seconds)
            cpu_s = processor_s(pids) - cpu_s
    except NothingComes:
        return Figures()
    if len(heads) < 2:
        return Figures()
    white = np.frombuffer(pixels, np.uint8)
    return _figures(heads, cpu_s, sent, stamp_of, float((white == 255).mean()), first.encoding)


def processor_s(pids: Sequence[int]) -> float:
    """Processor time that processes have taken, with all their threads."""
    return sum(_ticks(pid) for pid in pids) * _TICK_S


def sent_by_log(path: Path) -> Callable[[int, int], int]:
    """Counts in the file that ``source.py --log`` writes."""

    def count(first_ns: int, last_ns: int) -> int:
        data = path.read_bytes()
        stamps = np.frombuffer(data[: len(data) // 8 * 8], np.int64)
        return int(((stamps >= first_ns) & (stamps <= last_ns)).sum())

    return count


def sent_by_rate(rate_hz: float) -> Callable[[int, int], int]:
    """Counts what a source of that rate sends."""
    return lambda first_ns, last_ns: round((last_ns - first_ns) * rate_hz / 1e9) + 1


def _ticks(pid: int) -> int:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return int(fields[11]) + int(fields[12])


def _until(tap: Tap, seconds: float) -> list[Head]:
    end_s = time.monotonic() + seconds
    heads = []
    while time.monotonic() < end_s:
        heads.append(tap.next())
    return heads


def _figures(
    heads: list[Head],
    cpu_s: float,
    sent: Callable[[int, int], int] | None,
    stamp_of: Callable[[Head], int],
    white: float,
    encoding: str,
) -> Figures:
    arrived = np.array([head.arrived_ns for head in heads])
    stamps = np.array([stamp_of(head) for head in heads])
    fps = (len(heads) - 1) / (arrived[-1] - arrived[0]) * 1e9
    p50_ms = p99_ms = lost = float("nan")
    if stamps.all():
        p50_ms, p99_ms = np.percentile((arrived - stamps) / 1e6, (50, 99))
        if sent is not None:
            lost = 1 - len(np.unique(stamps)) / max(1, sent(stamps[0], stamps[-1]))
    return Figures(fps, cpu_s / len(heads) * 1e3, p50_ms, p99_ms, lost, white, encoding)
