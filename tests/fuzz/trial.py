"""One damaged input through the commands, and what is wrong with what they did."""

import contextlib
import io
import json
import logging
import resource
import time
import traceback
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fuzz.counts import count
from fuzz.page import send
from ros_visualise.commands import main
from ros_visualise.sources.logs.gopro import read_samples

MOST_MIB = 2048
QUICK = ("--view", "none", "--rate", "0", "--json")
_PLAYED_BY = {"video": "video", "kitti": "kitti", "kitti_odometry": "kitti"}


@dataclass(frozen=True)
class Done:
    """What a command did."""

    command: str
    status: int
    output: str
    errors: str

    @property
    def report(self) -> dict[str, Any]:
        return json.loads(self.output) if self.output else {}

    @property
    def faults(self) -> list[str]:
        """What no command may do, whatever it is given."""
        found = []
        if self.status not in (0, 1, 2):
            found.append(f"exit status {self.status}")
        if "Traceback" in self.errors:
            found.append("a traceback")
        if self.status in (1, 2) and not (self.errors or "notes" in self.output):
            found.append(f"{self.status} without a word")
        lines = self.errors.splitlines()
        if self.status == 2 and not all(line.startswith("ros-visualise: ") for line in lines):
            found.append("words that are not ours")
        if not (self.errors + self.output).replace("\n", "").isprintable():
            found.append("control characters")
        return [f"{self.command}: {fault}: {self.errors[-1500:]}" for fault in found]


def run(*arguments: object) -> Done:
    """A command in this process."""
    output, errors = io.StringIO(), io.StringIO()
    line = [str(argument) for argument in arguments]
    handlers = logging.getLogger().handlers
    before = handlers.copy()
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(errors):
        try:
            status = main(line)
        except SystemExit as end:
            status = int(end.code or 0)
        except BaseException:
            status = -1
            traceback.print_exc()
        handlers[:] = before  # one that a command added writes to what ends here
    return Done(line[0], status, output.getvalue(), errors.getvalue())


def examine(path: Path, kind: str, folder: Path, whole: Path | None = None) -> list[str]:
    """What is wrong with how the commands take an input.

    Args:
        path: of the input.
        kind: what it is, or was.
        folder: for what the commands write.
        whole: of which the input lacks a record, if that is all that is wrong with it.
    """
    before = peak_mib()
    begun = time.monotonic()
    if kind in _PARTS:
        done, found = [], _PARTS[kind](path)
    elif kind in _SETTINGS:
        done = [run(*_SETTINGS[kind](path, folder))]
        found = []
    else:
        done, found = _examine_recording(path, kind, folder, whole)
    found += [fault for one in done for fault in one.faults]
    if before < MOST_MIB < peak_mib():
        found.append(f"took {peak_mib()} MiB in {time.monotonic() - begun:.0f} s")
    return found


def _examine_recording(
    path: Path, kind: str, folder: Path, whole: Path | None
) -> tuple[list[Done], list[str]]:
    copy = folder / "copy.mcap"
    info = run("info", path, "--json")
    played = run(_PLAYED_BY.get(kind, "bag"), path, *QUICK)
    converted = run("convert", path, copy, "--json", "--overwrite")
    there = count(path, kind) or 0
    if whole is not None and kind in _COUNTED:
        there = max(there, count(whole, kind) or 0)
    found = []
    if info.status == 0 and not any(info.report.get("lost", {}).values()):
        found += _fewer("info", info.report["messages"], there)
    if played.status == 0:
        [source] = [n for n in ("player", "streamer") if n in played.report["nodes"]]
        found += _fewer(played.command, played.report["nodes"][source]["processed"], there)
    if converted.status == 0:
        found += _fewer("convert", converted.report["messages"], there)
        found += _fewer("the file", count(copy, "mcap") or 0, converted.report["messages"])
    return [info, played, converted], found


def _fewer(what: str, found: int, there: int) -> list[str]:
    return [f"{what}: {found} of {there} messages, without a word"] if found < there else []


def peak_mib() -> int:
    """The most memory that this process had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024


def _demo(path: Path, folder: Path) -> tuple[object, ...]:
    return ("demo", "landscape", "--size", "64x48", "--frames", 2, "--params", path, *QUICK)


def _mission(path: Path, folder: Path) -> tuple[object, ...]:
    still = ("--set", "quadrotor.camera_rate=0", "--set", "quadrotor.lidar_rate=0")
    return ("sim", "quadrotor", "--mission", path, "--duration", 0.1, *still, *QUICK)


def _calibration(path: Path, folder: Path) -> tuple[object, ...]:
    setting = f"streamer.camera_info_url={path}"
    return ("video", folder / "video.mkv", "--frames", 2, "--set", setting, *QUICK)


def _telemetry(path: Path) -> list[str]:
    found = list(read_samples(path.read_bytes(), {"GPS5", "ACCL", "GYRO"}))
    return [f"samples of {one.values.ndim} axes" for one in found if one.values.ndim != 2]


_COUNTED = ("bag", "mcap", "mcap_folder", "db3")
"""Kinds whose files count their messages, so that a missing one can be known."""

_PARTS = {"gpmf": _telemetry, "page": send}
_SETTINGS = {"params": _demo, "mission": _mission, "calibration": _calibration}
