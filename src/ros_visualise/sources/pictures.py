"""Pictures in files: a single one, or all of a folder in the order of their names."""

from __future__ import annotations

import contextlib
import logging
import os
from collections.abc import Generator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ros_visualise.core.errors import OpenError
from ros_visualise.core.limits import check_file, within_limits
from ros_visualise.core.regular_files import natural, read_file
from ros_visualise.data import Header, Image, Pixels
from ros_visualise.sources.formats import VIDEOS
from ros_visualise.sources.logs.stills import still_series
from ros_visualise.sources.recordings.series import SeriesRecording
from ros_visualise.sources.series import DamagedFile, Series
from ros_visualise.vision.color import encoding_of
from ros_visualise.vision.compression import decodable

log = logging.getLogger(__name__)

SUFFIXES = (".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp", ".webp", ".ppm", ".pgm", ".jp2")
_TOPIC, _FRAME = "/image_raw", "camera_optical"
_GIVEN = "give a picture (.jpg, .png, .tif and others), or a folder of them"
_AS_SHOWN = cv2.IMREAD_ANYDEPTH | cv2.IMREAD_ANYCOLOR  # upright, as its EXIF data says


def is_pictures(path: str | os.PathLike[str]) -> bool:
    """True if a path is called as a picture, or is a folder with pictures directly in it."""
    path = Path(path)
    return bool(_in_folder(path)) if path.is_dir() else path.suffix.lower() in SUFFIXES


def read_picture(path: Path) -> Image:
    """A picture in gray or colours, turned upright, without its alpha; raises OpenError."""
    try:
        with within_limits(path):
            check_file(path.stat().st_size)
        file = read_file(path)
    except FileNotFoundError:
        raise OpenError.missing(path) from None
    except OSError as error:
        raise OpenError(f"{path}: {error.strerror or error}; {_GIVEN}") from None
    pixels: Any = None
    with within_limits(path), contextlib.suppress(cv2.error):
        whole = decodable(file)
        if whole is not None:
            pixels = cv2.imdecode(np.frombuffer(whole, np.uint8), _AS_SHOWN)
    if pixels is None or pixels.dtype not in (np.uint8, np.uint16):
        raise OpenError(f"{path}: not a readable image; {_GIVEN}")
    found: Pixels = pixels
    return Image(found, encoding_of(found, "BGR"))


class Pictures:
    """Pictures as the images of a camera, one after the other.

    Args:
        path: a picture, or a folder with pictures.
        fps: pictures per second.

    Attributes:
        files: in order.
        faults: a note for each unreadable one.

    Raises:
        OpenError: no picture, or the only one cannot be read.
    """

    def __init__(self, path: str | os.PathLike[str], fps: float) -> None:
        self.files = _files(Path(path))
        self.faults: list[str] = []
        self._fps = fps
        if len(self.files) == 1:
            read_picture(self.files[0])

    @property
    def duration_ns(self) -> int:
        """Until the last picture has been shown as long as the others."""
        return self.stamp_ns(len(self.files))

    def stamp_ns(self, index: int) -> int:
        """When a picture is shown."""
        return round(index * 1e9 / self._fps)

    def read(self, start_ns: int = 0) -> Generator[tuple[int, Image], None, None]:
        """(Time, picture), from the one shown at ``start_ns`` on; unreadable ones are skipped."""
        first = min(int(start_ns * self._fps / 1e9 + 1e-6), len(self.files) - 1)
        for index, path in enumerate(self.files[first:], first):
            try:
                found = read_picture(path)
                yield (
                    self.stamp_ns(index),
                    replace(found, header=Header(self.stamp_ns(index), _FRAME)),
                )
            except OpenError as error:
                if str(error) not in self.faults:
                    log.warning("%s", error)
                    self.faults.append(str(error))


def recorded_pictures(path: Path) -> SeriesRecording:
    """The pictures of a folder as a recording, one each second."""
    pictures = Pictures(path, 1.0)

    def image(index: int) -> Image:
        try:
            found = read_picture(pictures.files[index])
        except OpenError as error:
            raise DamagedFile(pictures.files[index], str(error)) from None
        return replace(found, header=Header(pictures.stamp_ns(index), _FRAME))

    stamps_ns = np.array([pictures.stamp_ns(n) for n in range(len(pictures.files))], np.int64)
    series = Series(_TOPIC, Image, stamps_ns, image, slow=True)
    said = [replace(one, topic=f"/{one.topic}") for one in still_series(pictures.files)]
    size = sum(file.stat().st_size for file in pictures.files)
    return SeriesRecording(path, "pictures", size, [*said, series])


def picture_files(path: Path) -> list[Path]:
    """A picture, or the pictures directly in a folder, in order; raises OpenError without any."""
    found = _in_folder(path) if path.is_dir() else [path]
    if not found:
        videos = videos_in(path)
        hint = f"give a video, for instance {videos[0]}" if videos else _GIVEN
        raise OpenError(f"{path}: a folder without pictures; {hint}")
    return found


def _files(path: Path) -> list[Path]:
    found = picture_files(path)
    if videos := videos_in(path) if path.is_dir() else []:
        log.warning("%s: only pictures are played, not videos; to play one: %s", path, videos[0])
    return found


def videos_in(folder: Path) -> list[Path]:
    """The videos directly in a folder, by their names."""
    return _in_folder(folder, VIDEOS)


def _in_folder(folder: Path, suffixes: Sequence[str] = SUFFIXES) -> list[Path]:
    """The pictures, or others, directly in a folder: ``9.png`` before ``10.png``."""
    with contextlib.suppress(OSError):
        there = [one for one in folder.iterdir() if one.suffix.lower() in suffixes]
        return sorted((one for one in there if one.is_file()), key=natural)
    return []
