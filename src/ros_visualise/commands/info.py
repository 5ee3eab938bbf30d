"""``info``: what a file holds."""

from __future__ import annotations

import json
import time
from argparse import Namespace
from collections.abc import Callable, Iterator
from typing import Any

from ros_visualise import sources
from ros_visualise.commands.interruptible import interruptible

_COLUMN = 13


def run(args: Namespace) -> int:
    """Print what a file holds."""
    found = interruptible(lambda: sources.info(args.input))
    if args.json:
        print(json.dumps(found))
        return 0
    print("\n".join(_video_lines(found) if "codec" in found else _recording_lines(found)))
    return 0


def _video_lines(found: dict[str, Any]) -> Iterator[str]:
    for key, value in found.items():
        if key != "topics":
            yield f"{key + ':':<12}{value}"
    for name, topic in found["topics"].items():
        yield f"{name}  {topic['type']}  {topic['messages']} messages  {topic['hz']} Hz"


def _recording_lines(found: dict[str, Any]) -> Iterator[str]:
    """The lines of ``rosbag info``."""
    written = _written_in_ros1 if found["format"].startswith("rosbag ") else str
    rows: list[tuple[str, list[str]]] = [
        ("path", [found["path"]]),
        ("format", [found["format"]]),
        ("duration", [_duration(found["duration"])]),
        ("start", [_time(found["start"])]),
        ("end", [_time(found["end"])]),
        ("size", [_size(found["size"])]),
        ("messages", [str(found["messages"])]),
        ("compression", [found["compression"]]),
        ("types", _types(found["types"], written)),
        ("topics", _topics(found["topics"], written)),
        ("lost", _lost(found["lost"])),
    ]
    for name, lines in rows:
        for number, line in enumerate(lines):
            yield f"{name + ':' if number == 0 else '':<{_COLUMN}}{line}".rstrip()


def _types(types: dict[str, str], written: Callable[[str], str]) -> list[str]:
    names = {written(name): digest for name, digest in types.items()}
    width = max(map(len, names), default=0)
    return [f"{name:<{width}} [{digest}]" if digest else name for name, digest in names.items()]


def _topics(topics: dict[str, dict[str, Any]], written: Callable[[str], str]) -> list[str]:
    name_width = max(map(len, topics), default=0)
    count_width = max((len(str(topic["messages"])) for topic in topics.values()), default=0)
    rates = {name: _rate(topic["hz"]) for name, topic in topics.items()}
    rate_width = max(map(len, rates.values()), default=0)
    type_width = max((len(written(topic["type"])) for topic in topics.values()), default=0)
    lines = []
    for name, topic in topics.items():
        noun = "msg " if topic["messages"] == 1 else "msgs"
        line = f"{name:<{name_width}}   {topic['messages']:>{count_width}} {noun}"
        line += f" {'@' if rates[name] else ' '} {rates[name]:>{rate_width}}"
        line += f" : {written(topic['type']):<{type_width}}"
        if topic["connections"] > 1:
            line += f" ({topic['connections']} connections)"
        if "unreadable" in topic:
            line += f" (cannot be read: {topic['unreadable']})"
        lines.append(line)
    return lines


def _lost(lost: dict[str, Any]) -> list[str]:
    if not any(lost.values()):
        return []
    return [f"{lost['messages']} messages, {lost['bytes']} bytes", *lost["notes"]]


def _written_in_ros1(type_name: str) -> str:
    return type_name.replace("/msg/", "/")


def _rate(hz: float | None) -> str:
    if hz is None:
        return ""
    return f"{hz:.1f} Hz" if hz < 1000 else f"{hz / 1000:.1f} kHz"


def _size(size: int) -> str:
    short = f"{size / 1e6:.1f} MB" if size >= 1e6 else f"{size / 1e3:.1f} kB"
    return f"{short} ({size} bytes)"


def _duration(seconds: float) -> str:
    """``1.5s``, ``2:03s (123s)`` or ``1hr 2:03s (3723s)``, as ``rosbag info`` has it."""
    whole = int(seconds)
    minutes, hours = whole // 60, whole // 3600
    if not minutes:
        return f"{seconds:.1f}s"
    clock = f"{minutes % 60 if hours else minutes}:{whole % 60:02d}s ({whole}s)"
    return f"{hours}hr {clock}" if hours else clock


def _time(seconds: float) -> str:
    """Local time with its zone, and seconds."""
    hundredths = round(seconds * 100)
    local = time.localtime(hundredths // 100)
    day = time.strftime("%b %d %Y %H:%M:%S", local)
    return f"{day}.{hundredths % 100:02d} {time.strftime('%Z', local)} ({hundredths / 100:.2f})"
