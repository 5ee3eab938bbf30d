"""The moving picture that everything is measured on, in every size."""

import os
import subprocess
from pathlib import Path

SIZES = {"480p": (640, 480), "1080p": (1920, 1080), "4K": (3840, 2160)}
RATE_HZ = 30
_RECORDING = "video/vtest.avi"
_FRAMES = 90


def picture() -> Path | None:
    """People who walk by: the recording that has edges at every size, where it is there."""
    folder = os.environ.get("ROS_VISUALISE_DATA")
    path = Path(folder) / _RECORDING if folder else None
    return path if path is not None and path.is_file() else None


def make(picture: Path | None, size: str, folder: Path) -> Path:
    """Some seconds of the picture as H.264 of that size; without a picture FFmpeg's test scene."""
    path = folder / f"{size}.mp4"
    width, height = SIZES[size]
    if picture is None:
        given = ["-f", "lavfi", "-i", f"testsrc2=size={width}x{height}:rate={RATE_HZ}"]
    else:
        given = ["-stream_loop", "-1", "-r", str(RATE_HZ), "-i", picture]
    scaled = ["-vf", f"scale={width}:{height}:flags=bicubic"]
    coded = ["-frames:v", str(_FRAMES), "-an", "-dn", "-write_tmcd", "0"]
    h264 = ["-c:v", "libx264", "-preset", "superfast", "-crf", "20", "-bf", "0"]
    _ffmpeg(*given, *scaled, *coded, *h264, "-pix_fmt", "yuv420p", path)
    return path


def lengthen(path: Path, frames: int) -> Path:
    """The same over and over, for a player that does not loop."""
    long = path.with_name(f"{path.stem}_long.mp4")
    _ffmpeg("-stream_loop", str(frames // _FRAMES), "-i", path, "-c", "copy", long)
    return long


def still(path: Path) -> Path:
    """One image of it."""
    image = path.with_suffix(".png")
    _ffmpeg("-i", path, "-frames:v", "1", image)
    return image


def _ffmpeg(*arguments: str | Path) -> None:
    command = ["ffmpeg", "-nostdin", "-y", "-loglevel", "error", *map(str, arguments)]
    subprocess.run(command, check=True)
