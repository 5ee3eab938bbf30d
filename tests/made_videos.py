"""Small video files with known content, for the tests of the sources."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np

MS = 1_000_000


def numbered(count: int, width: int = 32, height: int = 24) -> list[np.ndarray]:
    """BGR images; each differs from the others and from its own mirrored or turned copies."""
    images = []
    for number in range(count):
        image = np.full((height, width, 3), (40, 5 * number + 10, 200 - 4 * number), np.uint8)
        image[: height // 2, : width // 2] = (250, 20, 5 * number)
        images.append(image)
    return images


def write_video(
    path: Path,
    images: Sequence[np.ndarray],
    *,
    codec: str = "ffv1",
    pix_fmt: str = "bgr0",
    source_format: str = "bgr24",
    times_ms: Sequence[int] | None = None,
    container_format: str | None = None,
    container_options: dict[str, str] | None = None,
    options: dict[str, str] | None = None,
    tags: dict[str, int] | None = None,
) -> Path:
    """A video of these images, by default lossless and at 25 fps.

    ``source_format`` is the pixel format of the arrays; if it is ``pix_fmt``, nothing is converted.
    """
    times_ms = times_ms or [40 * n for n in range(len(images))]
    with av.open(
        str(path), "w", format=container_format, container_options=container_options or {}
    ) as container:
        stream: Any = container.add_stream(codec, rate=25, options=options or {})
        stream.width, stream.height = images[0].shape[1], images[0].shape[0]
        if source_format.startswith("yuv444"):
            stream.height, stream.width = images[0].shape[1:]
        stream.pix_fmt = pix_fmt
        for name, value in (tags or {}).items():
            setattr(stream.codec_context, name, value)
        if times_ms[-1] % 40:
            stream.codec_context.time_base = Fraction(1, 1000)
        base = Fraction(1, 1000) if times_ms[-1] % 40 else Fraction(1, 25)
        for image, time_ms in zip(images, times_ms, strict=True):
            frame = _frame(image, source_format)
            if source_format != pix_fmt:
                frame = frame.reformat(format=pix_fmt)
            for name, value in (tags or {}).items():
                setattr(frame, name, value)
            frame.time_base, frame.pts = base, round(time_ms / 1000 / base)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path


def write_sound(path: Path) -> Path:
    """A file with sound alone."""
    with av.open(str(path), "w") as container:
        stream: Any = container.add_stream("pcm_s16le", rate=8000)
        stream.layout = "mono"
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 8000), np.int16), "s16", "mono")
        frame.sample_rate = 8000
        container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path


def _frame(image: np.ndarray, pixel_format: str) -> av.VideoFrame:
    if not pixel_format.startswith("yuv444"):
        return av.VideoFrame.from_ndarray(image, format=pixel_format)
    frame = av.VideoFrame(image.shape[2], image.shape[1], pixel_format)
    for plane, values in zip(frame.planes, image, strict=True):
        rows = np.zeros((values.shape[0], plane.line_size // values.itemsize), values.dtype)
        rows[:, : values.shape[1]] = values
        plane.update(rows.tobytes())
    return frame
