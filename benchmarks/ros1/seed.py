"""The scripts that the project grew out of, as they run here.

They are taken from a clone of https://github.com/BarbaraMMCS/UAV_navigation_ROS into a scratch
folder. They draw in OpenCV's windows outside the main thread, which hangs, so that as they are
nothing arrives. Without windows the sliders have their starting values and nothing is drawn;
nothing else is changed.
"""

import subprocess
from dataclasses import dataclass
from pathlib import Path

_FOLDER = "ros_visualise/src"
_WITHOUT_WINDOWS = {
    "fps_control.py": {
        "cv2.namedWindow(self.window)": "pass",
        'cv2.createTrackbar("FPS", self.window, self.fps_param, 30, self.nothing)': "pass",
        'cv2.getTrackbarPos("FPS", self.window)': "self.fps_param",
        "            self.show(data)\n": "",
    },
    "filters.py": {
        "cv2.namedWindow(self.window)": "pass",
        "cv2.createTrackbar(name, window, a, b, call)": "pass",
        'cv2.getTrackbarPos("Threshold", self.window)': "128",
        'cv2.getTrackbarPos("Gray", self.window)': "1",
        "            self.show(data)\n": "",
    },
    "edge_detector.py": {
        "cv2.namedWindow(self.window)": "pass",
        "cv2.createTrackbar('Min', self.window, 200, 800, self.min_change)": "pass",
        "cv2.createTrackbar('Max', self.window, 300, 800, self.max_change)": "pass",
        "        self.show(edges)\n": "",
    },
}


@dataclass(frozen=True)
class Seed:
    """Its scripts, and the interpreter that has rospy, cv_bridge and imutils."""

    folder: Path
    python: str

    @classmethod
    def check_out(cls, repository: Path, scratch: Path, python: str, windows: bool) -> "Seed":
        """Take the scripts out of a git repository.

        Raises:
            SystemExit: it is another one, or the interpreter lacks something.
        """
        for module in ("rospy", "cv_bridge.boost.cv_bridge_boost", "imutils"):
            if subprocess.run([python, "-c", f"import {module}"], capture_output=True).returncode:
                raise SystemExit(
                    f"the seed needs {module} for {python}: apt install python3-cv-bridge, "
                    "pip install --no-deps imutils"
                )
        archive = ["git", "-C", repository, "archive", "HEAD", _FOLDER]
        tar = subprocess.run(archive, stdout=subprocess.PIPE, check=True).stdout
        subprocess.run(["tar", "-x", "-C", scratch], input=tar, check=True)
        seed = cls(scratch / _FOLDER, python)
        if not windows:
            for name, changes in _WITHOUT_WINDOWS.items():
                _substitute(seed.folder / name, changes)
        return seed

    def streamer(self, video: Path) -> list[str | Path]:
        """Publishes the video as fast as it decodes it, without a window."""
        return self._script(
            "streamer.py", "_topic_pub:=/image_raw", f"_video_path:={video}", "_display:=0",
            "_num_frames:=1000000",
        )  # fmt: skip

    def nodes(self) -> list[list[str | Path]]:
        """fps_control -> filters -> edge_detector, on the topics of its launch file."""
        topics = ("/image_raw", "/controled_stream", "/processed_image", "/detected")
        names = ("fps_control.py", "filters.py", "edge_detector.py")
        return [
            self._script(name, f"_topic_sub:={before}", f"_topic_pub:={after}", "_fps:=30")
            for name, before, after in zip(names, topics, topics[1:], strict=False)
        ]

    def _script(self, name: str, *params: str) -> list[str | Path]:
        return [self.python, self.folder / name, *params]


def _substitute(path: Path, changes: dict[str, str]) -> None:
    text = path.read_text()
    for old, new in changes.items():
        if old not in text:
            raise SystemExit(f"{path.name} of the seed is another one: it has no {old!r}")
        text = text.replace(old, new)
    path.write_text(text)
