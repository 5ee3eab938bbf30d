"""Numbered files of frames, and files of lines; also damaged ones."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

from ros_visualise.core.errors import TooLarge
from ros_visualise.core.limits import check_file, check_numbers
from ros_visualise.core.regular_files import read_file, read_text
from ros_visualise.sources.recordings import Loss
from ros_visualise.sources.series import DamagedFile

_CUT_OFF = "(cut off)"


@dataclass(frozen=True)
class Files:
    """The frames in a folder in the order of their numbers, which may have gaps."""

    folder: Path
    names: tuple[str, ...] = ()
    numbers: tuple[int, ...] = ()
    size: int = 0

    def __len__(self) -> int:
        return len(self.names)

    def path(self, index: int) -> Path:
        """The file at a place in the list."""
        return self.folder / self.names[index]

    def read(self, index: int) -> bytes:
        """The bytes of a file.

        Raises:
            DamagedFile: it is empty, gone, too large, or may not be read.
        """
        path = self.path(index)
        try:
            check_file(path.stat().st_size)
            data = read_file(path)
        except TooLarge as error:
            raise DamagedFile(path, str(error)) from None
        except OSError as error:
            raise DamagedFile(path, error.strerror or str(error)) from None
        if not data:
            raise DamagedFile(path, "empty")
        return data


def list_files(folder: Path, *suffixes: str) -> Files:
    """The numbered files of the first of these kinds that is there; perhaps none."""
    try:
        with os.scandir(folder) as items:
            files = [(item.name, item.stat().st_size) for item in items if item.is_file()]
    except OSError:
        return Files(folder)
    for suffix in suffixes:
        matches = ((re.fullmatch(rf"(\d+)\.{suffix}", name), size) for name, size in files)
        found = sorted((int(match[1]), match[0], size) for match, size in matches if match)
        if found:
            numbers, names, sizes = zip(*found, strict=True)
            return Files(folder, names, numbers, sum(sizes))
    return Files(folder)


def read_lines(path: Path) -> list[str]:
    """The lines of a text; in place of a last one that is cut off, words that nobody can read.

    Raises:
        DamagedFile: it may not be read, or is too large.
    """
    try:
        check_numbers(path.stat().st_size)
        text = read_text(path)
    except TooLarge as error:
        raise DamagedFile(path, str(error)) from None
    except OSError as error:
        raise DamagedFile(path, error.strerror or str(error)) from None
    lines = text.splitlines()
    if len(lines) > 1 and not text.endswith("\n") and _last_word(lines[-1]) < _last_word(lines[-2]):
        lines[-1] = _CUT_OFF
    return lines


def _last_word(line: str) -> int:
    """Its length; KITTI's numbers are as long as one another, but for their signs."""
    return len((line.split() or [""])[-1].lstrip("-"))


def add_damage(loss: Loss, folder: Path, error: DamagedFile, messages: int = 0) -> None:
    """Say what a damaged file costs, by its name as seen from the folder that is read."""
    loss.messages += messages
    loss.bytes += error.size
    loss.notes.append(f"{os.path.relpath(error.path, folder)}: {error.why}")


def add_missing(loss: Loss, sensor: str, frames: int, times: int) -> None:
    """Say how many frames of a sensor are missing, of those that its file of times counts."""
    if frames < times:
        loss.messages += times - frames
        loss.notes.append(f"{sensor}: {times - frames} of {times} frames are missing")
