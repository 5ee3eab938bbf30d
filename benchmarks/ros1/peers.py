"""What a user would take instead, with the commands that start it."""

import shutil
import sys
from pathlib import Path

from ros_visualise.running.executables import command_of

HERE = Path(__file__).parent
LOW, HIGH = 200, 300

Command = list[str | Path]


def source(video: Path, rate: float, log: Path | None = None, mark: bool = False) -> Command:
    """The one source of all measurements of single nodes."""
    logged = ["--log", log] if log else []
    marked = ["--mark"] if mark else []
    return [sys.executable, HERE / "source.py", video, "--rate", str(rate), *logged, *marked]


def opencv_apps() -> Command:
    """C++: blurs the colour image 3x3, makes it gray, Canny; its other blurs are off."""
    return [
        "/usr/lib/opencv_apps/edge_detection",
        "__name:=edge_detection",
        "image:=image_raw",
        "edge_detection/image:=edges",
        "_edge_type:=2",
        f"_canny_threshold1:={LOW}",
        f"_canny_threshold2:={HIGH}",
        "_apply_blur_pre:=false",
        "_apply_blur_post:=false",
        "_debug_view:=false",
        "_queue_size:=1",
    ]


def image_proc() -> Command:
    """C++: makes gray and colour images, and rectifies those that somebody wants."""
    return ["/usr/lib/image_proc/image_proc"]


def rospy_canny() -> Command:
    """Gray, Canny."""
    return [sys.executable, HERE / "rospy_canny.py", f"_low:={LOW}", f"_high:={HIGH}"]


def throttle(rate: float, out: str) -> Command:
    """C++: lets a message pass when enough time has gone since the last one."""
    return ["/usr/lib/topic_tools/throttle", "messages", "image_raw", str(rate), out]


def image_publisher(path: Path, rate: float) -> Command:
    """C++: publishes a picture, or reads a video file, at a rate."""
    return [
        "/usr/lib/image_publisher/image_publisher",
        path,
        "__name:=image_publisher",
        "image_publisher/image_raw:=image_raw",
        f"_publish_rate:={rate}",
    ]


def ours(name: str, *remappings: str, **params: object) -> Command:
    """One of our executables; ``__`` in a parameter's name parts it from its node's."""
    given = [f"_{key.replace('__', '/')}:={value}" for key, value in params.items()]
    return [*command_of(name), *remappings, *given]


def missing() -> list[str]:
    """The peers that are not installed, as Debian calls them."""
    programs = {
        "ros-opencv-apps": opencv_apps()[0],
        "topic-tools": throttle(1, "")[0],
        "ros-image-proc": image_proc()[0],
        "ros-image-publisher": image_publisher(Path(), 1)[0],
        "python3-roslaunch": "roscore",
        "ffmpeg": "ffmpeg",
    }
    return [package for package, program in programs.items() if shutil.which(program) is None]
