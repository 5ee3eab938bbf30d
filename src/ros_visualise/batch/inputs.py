"""The recordings of a batch: found, sized, and identified by their content."""

from __future__ import annotations

import glob
import hashlib
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from ros_visualise.core.errors import OpenError, UsageError
from ros_visualise.core.regular_files import open_file, read_text
from ros_visualise.sources.formats import VIDEOS
from ros_visualise.sources.opening import is_recorded_folder, is_recording
from ros_visualise.sources.pictures import is_pictures
from ros_visualise.ui.file_chooser import SUFFIXES

_WHOLE_BYTES = 64 << 20
_SAMPLE_BYTES = 1 << 16
_SAMPLES = 64
_SUBTITLES = ".srt"
_OF_ANYTHING = ".bin"  # also that of ArduPilot's logs
_LIST = "@"


class FoundInput(NamedTuple):
    """A recording: its name in the tables, its absolute path, and the bytes of its files."""

    name: str
    path: str
    size: int


def find_inputs(given: Sequence[str]) -> list[FoundInput]:
    """The recordings below files, folders and patterns, and in ``@lists`` of these; each once.

    A name is the path below the folder that all have in common.

    Raises:
        OpenError: a list cannot be read, or a path is missing.
        UsageError: nothing is found.
    """
    for text in given:
        if not (text.startswith(_LIST) or glob.has_magic(text) or os.path.lexists(text)):
            raise OpenError.missing(text)
    once: dict[str, str] = {}  # a file has several paths where links lead to it
    for path in sorted(os.path.abspath(path) for text in given for path in _expand(text)):
        once.setdefault(os.path.realpath(path), path)
    found = [*once.values()]
    if not found:
        raise UsageError(f"{' '.join(given)}: no recordings; give files, folders or patterns")
    common = os.path.commonpath([os.path.dirname(path) for path in found])
    return [
        FoundInput(Path(os.path.relpath(path, common)).as_posix(), path, size_of(path))
        for path in found
    ]


def size_of(path: str) -> int:
    """Bytes of a file, or of all files of a folder; of a missing one 0."""
    total = 0
    for file in _files(path):
        with suppress(OSError):
            total += os.stat(file).st_size
    return total


def content_of(path: str) -> str:
    """A digest of a recording's bytes, which do not depend on its name.

    Of files above 64 MiB it is made of samples, the size and the time of the last change.

    Raises:
        OSError: it cannot be read.
    """
    digest = hashlib.sha256()
    for file in _files(path):
        about = os.stat(file)
        inner = os.path.relpath(file, path) if file != path else ""
        digest.update(f"{inner}\0{about.st_size}\0".encode(errors="surrogateescape"))
        with open_file(file) as opened:
            if about.st_size <= _WHOLE_BYTES:
                while block := opened.read(1 << 20):
                    digest.update(block)
                continue
            digest.update(str(about.st_mtime_ns).encode())
            for number in range(_SAMPLES):
                opened.seek((about.st_size - _SAMPLE_BYTES) * number // (_SAMPLES - 1))
                digest.update(opened.read(_SAMPLE_BYTES))
    return digest.hexdigest()


def signature_of(path: str) -> str:
    """Sizes and times of a recording's files; raises OSError."""
    digest = hashlib.sha256()
    for file in _files(path):
        about = os.stat(file)
        line = f"{file}\0{about.st_size}\0{about.st_mtime_ns}\0{about.st_ino}\n"
        digest.update(line.encode(errors="surrogateescape"))
    return digest.hexdigest()


def _files(path: str) -> Iterator[str]:
    if not os.path.isdir(path):
        yield path
        return
    for folder, folders, names in os.walk(path):
        folders.sort()
        yield from (os.path.join(folder, name) for name in sorted(names))


def _expand(text: str) -> Iterable[str]:
    if text.startswith(_LIST):
        return [path for line in _lines(Path(text[1:])) for path in _expand(line)]
    if os.path.isdir(text):
        return [text] if _is_one(Path(text)) else list(_below(Path(text)))
    if os.path.lexists(text) or not glob.has_magic(text):
        return [text]
    matched = [Path(one) for one in sorted(glob.glob(text, recursive=True))]
    folders = {one for one in matched if one.is_dir() and _is_one(one)}
    files = [one for one in matched if not folders.intersection(one.parents)]
    return [str(one) for one in files if one in folders or _is_wanted(one)]


def _lines(path: Path) -> list[str]:
    try:
        lines = [line.strip() for line in read_text(path).splitlines()]
    except FileNotFoundError:
        raise OpenError.missing(path) from None
    except OSError as error:
        raise OpenError.unreadable(path, error) from None
    return [line for line in lines if line and not line.startswith("#")]


def _below(folder: Path, above: tuple[str, ...] = ()) -> Iterator[str]:
    """The recordings in a folder and below it; its pictures are one if there is no other in it."""
    real = os.path.realpath(folder)
    if real in above:
        return  # a link back
    try:
        there = sorted(folder.iterdir())
    except OSError:
        return
    here = {path for path in there if (_is_one(path) if path.is_dir() else _is_wanted(path))}
    for path in there:
        if path in here:
            yield str(path)
        elif path.is_dir():
            yield from _below(path, (*above, real))
    if not here and is_pictures(folder):
        yield str(folder)


def _is_one(folder: Path) -> bool:
    try:
        return is_recorded_folder(folder)
    except OSError:
        return False


def _is_wanted(path: Path) -> bool:
    """True for a file that is a recording or is called as one; false for a film's subtitles."""
    if path.is_dir() or path.name.startswith("."):
        return False
    suffix = path.suffix.lower()
    if suffix == _SUBTITLES:
        beside = (path.with_suffix(end) for film in VIDEOS for end in (film, film.upper()))
        return not any(one.exists() for one in beside)
    return (suffix in SUFFIXES and suffix != _OF_ANYTHING) or is_recording(path)
