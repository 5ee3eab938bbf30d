"""``info``: the contents of a file."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from ros_visualise.commands import Command
from ros_visualise.core.printing import counted, escaped, print_json, print_result, sized
from ros_visualise.running.arguments import argument, option
from ros_visualise.running.options import MemoryOptions

_COLUMN = 13
_FIRST_DATE_S = 365 * 86_400  # times before 1971 count from a start


@dataclass(frozen=True, kw_only=True)
class InfoOptions(MemoryOptions):
    """Options of ``info``."""

    input: str = argument("a recording or a video", metavar="FILE")
    check: bool = option(False, "read the whole file, and report damage")
    json: bool = option(False, "print the contents as one JSON object")


def run(options: InfoOptions) -> int:
    """Print the contents of a file; 1 if data is lost."""
    from ros_visualise import sources
    from ros_visualise.running.interruptible import interruptible

    found = interruptible(lambda: sources.info(options.input, options.check))
    if options.json:
        print_json(found)
    else:
        print_result(_lines(found))
    return int(bool(found["lost"]["notes"]))


def _lines(found: dict[str, Any]) -> Iterator[str]:
    """Lines as of ``rosbag info``; for a video, with its images."""
    written = _written_in_ros1 if found["format"].startswith("rosbag ") else escaped
    rows: list[tuple[str, list[str]]] = [
        ("path", [found["path"]]),
        ("format", [found["format"]]),
        ("duration", [_duration(found["duration"])]),
        ("start", [_time(found["start"])]),
        ("end", [_time(found["end"])]),
        ("size", [_size(found["size"])]),
        ("messages", [str(found["messages"])]),
        ("compression", [found["compression"]] if "compression" in found else []),
        ("images", _images(found)),
        ("types", _types(found.get("types", {}), written)),
        ("topics", _topics(found["topics"], written)),
        ("lost", _lost(found["lost"])),
    ]
    for name, lines in rows:
        for number, line in enumerate(lines):
            yield f"{name + ':' if number == 0 else '':<{_COLUMN}}{line}".rstrip()


def _images(found: dict[str, Any]) -> list[str]:
    if "codec" not in found:
        return []
    return [f"{found['width']}x{found['height']}, {found['fps']:.4g} fps, {found['codec']}"]


def _types(types: dict[str, str], written: Callable[[str], str]) -> list[str]:
    names = {written(name): digest for name, digest in types.items()}
    width = max(map(len, names), default=0)
    return [f"{name:<{width}} [{digest}]" if digest else name for name, digest in names.items()]


def _topics(topics: dict[str, dict[str, Any]], written: Callable[[str], str]) -> list[str]:
    topics = {escaped(name): topic for name, topic in topics.items()}
    name_width = max(map(len, topics), default=0)
    count_width = max((len(str(topic["messages"])) for topic in topics.values()), default=0)
    rates = {name: _rate(topic["hz"]) for name, topic in topics.items()}
    rate_width = max(map(len, rates.values()), default=0)
    type_width = max((len(written(topic["type"])) for topic in topics.values()), default=0)
    lines = []
    for name, topic in topics.items():
        noun = "msg " if topic["messages"] == 1 else "msgs"
        line = f"{name:<{name_width}}   {topic['messages']:>{count_width}} {noun}"
        line += f" @ {rates[name]:>{rate_width}}"
        line += f" : {written(topic['type']):<{type_width}}"
        if topic.get("connections", 1) > 1:
            line += f" ({topic['connections']} connections)"
        if "unreadable" in topic:
            line += f" (cannot be read: {topic['unreadable']})"
        lines.append(line)
    return lines


def _lost(lost: dict[str, Any]) -> list[str]:
    if not lost["notes"]:
        return []
    known = [counted(lost[f"{what}s"], what) for what in ("message", "byte") if lost[f"{what}s"]]
    return [", ".join(known) or "an unknown number of messages", *lost["notes"]]


def _written_in_ros1(type_name: str) -> str:
    return escaped(type_name.replace("/msg/", "/"))


def _rate(hz: float | None) -> str:
    if hz is None:
        return "-"
    if hz < 1:
        return f"{hz:.2g} Hz"
    return f"{hz:.1f} Hz" if hz < 1000 else f"{hz / 1000:.1f} kHz"


def _size(size: int) -> str:
    return f"{sized(size)} ({size} bytes)"


def _duration(seconds: float) -> str:
    """``1.5s``, ``2:03s (123s)`` or ``1hr 2:03s (3723s)``, as ``rosbag info`` has it."""
    whole = int(seconds)
    minutes, hours = whole // 60, whole // 3600
    if not minutes:
        return f"{seconds:.1f}s"
    clock = f"{minutes % 60 if hours else minutes}:{whole % 60:02d}s ({whole}s)"
    return f"{hours}hr {clock}" if hours else clock


def _time(seconds: float) -> str:
    """Local time with its zone, and seconds; seconds alone for times that count from a start."""
    if seconds < _FIRST_DATE_S:
        return f"{seconds:.2f}"
    hundredths = round(seconds * 100)
    local = time.localtime(hundredths // 100)
    day = time.strftime("%b %d %Y %H:%M:%S", local)
    return f"{day}.{hundredths % 100:02d} {time.strftime('%Z', local)} ({hundredths / 100:.2f})"


COMMAND = Command("print what is in a recording or a video", InfoOptions, run)
