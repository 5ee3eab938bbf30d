"""KITTI's folders, from any path at or above them, and the files of frames and lines in them."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field
from pathlib import Path

from ros_visualise.core.errors import OpenError, TooLarge
from ros_visualise.core.limits import check_file, check_numbers
from ros_visualise.core.regular_files import read_file, read_text
from ros_visualise.sources.recordings import Loss
from ros_visualise.sources.series import DamagedFile

CAMERAS = range(4)
"""0 and 1 are gray, 2 and 3 in colour; 0 and 2 left, 1 and 3 right."""

PARTS = {"oxts", "velodyne_points", *(f"image_{camera:02d}" for camera in CAMERAS)}
"""The folders of a raw drive's sensors."""

_CUT_OFF = "(cut off)"
_PART_DEPTH = 2  # of image_02/data in a drive
_DEPTH = 3  # of the folder above a benchmark: dataset/sequences/00
_MOST_FOLDERS = 2000  # searched in, for example in a home folder
_SEQUENCE_PARTS = {"velodyne", *(f"image_{camera}" for camera in CAMERAS)}
_LISTED = 5


@dataclass(frozen=True)
class FrameFiles:
    """The frames in a folder in the order of their numbers, which may have gaps."""

    folder: Path
    names: tuple[str, ...] = ()
    numbers: tuple[int, ...] = ()
    size: int = 0

    def __len__(self) -> int:
        return len(self.names)

    def path(self, index: int) -> Path:
        """Path of a file, by its place in the list."""
        return self.folder / self.names[index]

    def read(self, index: int) -> bytes:
        """The bytes of a file; raises DamagedFile if it is empty, too large or unreadable."""
        path = self.path(index)
        try:
            check_file(path.stat().st_size)
            data = read_file(path)
        except (OSError, TooLarge) as error:
            raise DamagedFile(path, _reason(error)) from None
        if not data:
            raise DamagedFile(path, "empty")
        return data


@dataclass
class Findings:
    """Notes on the files of a folder, and what of them is lost."""

    folder: Path
    notes: list[str] = field(default_factory=list)
    loss: Loss = field(default_factory=Loss)

    def lose(self, error: DamagedFile, messages: int = 0) -> None:
        """Note a damaged file beside the frames, and the number of messages that it costs."""
        self.loss.messages += messages
        self.loss.bytes += error.size
        self.loss.notes.append(f"{os.path.relpath(error.path, self.folder)}: {error.why}")

    def compare(self, sensor: str, frames: int, times: int) -> None:
        """Note the missing frames of a sensor, of those that its file of times counts."""
        if frames < times:
            self.loss.messages += times - frames
            self.loss.notes.append(f"{sensor}: {times - frames} of {times} frames are missing")


def list_files(folder: Path, *suffixes: str) -> FrameFiles:
    """The numbered files of the first of these kinds that a folder has; perhaps none."""
    try:
        with os.scandir(folder) as items:
            files = [(item.name, item.stat().st_size) for item in items if item.is_file()]
    except OSError:
        return FrameFiles(folder)
    for suffix in suffixes:
        matches = ((re.fullmatch(rf"(\d+)\.{suffix}", name), size) for name, size in files)
        found = sorted((int(match[1]), match[0], size) for match, size in matches if match)
        if found:
            numbers, names, sizes = zip(*found, strict=True)
            return FrameFiles(folder, names, numbers, sum(sizes))
    return FrameFiles(folder)


def read_lines(path: Path) -> list[str]:
    """The lines of a text, the last one replaced if it is cut off; raises DamagedFile."""
    try:
        check_numbers(path.stat().st_size)
        text = read_text(path)
    except (OSError, TooLarge) as error:
        raise DamagedFile(path, _reason(error)) from None
    lines = text.splitlines()
    if len(lines) > 1 and not text.endswith("\n") and _last_word(lines[-1]) < _last_word(lines[-2]):
        lines[-1] = _CUT_OFF
    return lines


def find_folder(path: Path) -> Path:
    """The only drive or sequence in ``path``, which may be that folder itself; raises OpenError."""
    found = find_folders(path)
    if not found:
        raise OpenError(
            f"{path}: not a KITTI drive; give a folder that holds oxts, velodyne_points or"
            " image_00, or a sequence of the odometry benchmark"
        )
    if len(found) > 1:
        names = ", ".join(str(one.relative_to(path)) for one in found[:_LISTED])
        more = f" and {len(found) - _LISTED} more" if len(found) > _LISTED else ""
        raise OpenError(f"{path}: holds {names}{more}; choose one, for instance {found[0]}")
    return found[0]


def find_folders(path: Path) -> list[Path]:
    """All drives and sequences in a folder, as far as a search of bounded length finds them."""
    level, searched = [path], 0
    found: list[Path] = []
    for _ in range(_DEPTH + 1):
        below: list[Path] = []
        for folder in level:
            searched += 1
            if searched > _MOST_FOLDERS:
                return found
            if is_whole(folder):
                found.append(folder)
            else:
                below += _folders(folder)
        level = below
    return found


def is_whole(folder: Path) -> bool:
    """True for a drive and for a sequence."""
    return is_drive(folder) or is_sequence(folder)


def find_whole(part: Path) -> Path | None:
    """The drive or the sequence that a folder belongs to, if any."""
    above = part.absolute().parents[:_PART_DEPTH]
    return next(filter(is_whole, above), None)


def is_sequence(folder: Path) -> bool:
    """True if it is a sequence of the odometry benchmark."""
    names = _names(folder)
    if not names & {"times.txt", "calib.txt"}:
        return False
    return bool(names & _SEQUENCE_PARTS) or poses_file(folder).is_file()


def poses_file(sequence: Path) -> Path:
    """The benchmark's file with a sequence's ground truth: ``poses/04.txt``."""
    sequence = sequence.absolute()
    return sequence.parents[1] / "poses" / f"{sequence.name}.txt"


def is_drive(folder: Path) -> bool:
    """True if it holds a sensor's folder as the raw drives have it: with its ``data`` below."""
    return any((folder / name / "data").is_dir() for name in _names(folder) & PARTS)


def _folders(folder: Path) -> list[Path]:
    try:
        with os.scandir(folder) as items:
            names = [i.name for i in items if i.is_dir() and not i.name.startswith(".")]
    except OSError:
        return []
    return [folder / name for name in sorted(names)]


def _names(folder: Path) -> set[str]:
    try:
        return set(os.listdir(folder))
    except OSError:
        return set()


def _last_word(line: str) -> int:
    """Length of a line's last word; KITTI's numbers have equal lengths, but for their signs."""
    return len((line.split() or [""])[-1].lstrip("-"))


def _reason(error: OSError | TooLarge) -> str:
    return getattr(error, "strerror", None) or str(error)
