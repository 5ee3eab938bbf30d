"""The node that calibrates a camera from live views of a board."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.core.params import param
from ros_visualise.data import Deferred, Image
from ros_visualise.landmarks.calibration.boards import BoardKind, board_of
from ros_visualise.landmarks.calibration.calibrating import CameraCalibration, calibrate
from ros_visualise.landmarks.calibration.collecting import ViewCollector
from ros_visualise.landmarks.calibration.lenses import Lens
from ros_visualise.landmarks.calibration.progress import draw_progress
from ros_visualise.landmarks.calibration.views import BoardView
from ros_visualise.nodes import action, node
from ros_visualise.sinks.files import save_again
from ros_visualise.sources.calibration import path_of, to_yaml
from ros_visualise.vision.color import gray_of

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class CalibratorParams:
    """Parameters of `CameraCalibrator`."""

    pattern: BoardKind = param(BoardKind.CHESSBOARD, "pattern on the board")
    board: str = param(
        "9x6",
        "COLUMNSxROWS: inner corners of a chessboard, squares of a ChArUco board, tags of"
        " an AprilGrid",
    )
    share: float = param(
        0.0,
        "side of a ChArUco marker as a fraction of the side of a square, or gap between the tags of"
        " an AprilGrid as a fraction of the side of a tag; 0: the usual value",
        min=0,
        max=0.95,
    )
    dictionary: str = param("", "marker dictionary, by its OpenCV name; empty: the default")
    model: Lens = param(Lens.PINHOLE, "lens model")
    file: str = param(
        "camera.yaml",
        "YAML file to save to; give it to the camera as camera_info_url",
        saved=False,
        file=bool,
    )


@node(
    "calibrator",
    params=CalibratorParams,
    inputs={"image": Image},
    outputs={"coverage": Image},
    topics={"coverage": "/coverage"},
    on_demand=("coverage",),
    splittable=False,
)
class CameraCalibrator:
    """Collects views of a board, and calibrates the camera from them on request."""

    def __init__(self, params: CalibratorParams) -> None:
        self._params = params
        self._found: CameraCalibration | None = None
        self._notice = ""
        self._latest: Image | None = None
        self._view: BoardView | None = None
        self._begin(params)

    def step(self, image: Image, params: CalibratorParams) -> Image:
        """The image, with the board detected in it and the area covered so far."""
        if _board(params) != _board(self._params):
            self._begin(params)
        self._params = params
        self._latest = image
        name = f"{image.header.stamp_ns / 1e9:.2f} s"
        self._view = self._collector.add(image, name, thorough=False)
        return self._picture(image)

    @action("calibrate from the views so far")
    def calibrate(self) -> Image | None:
        """Calibrate; the picture shows the residuals."""
        try:
            self._found = found = calibrate(self._collector.views, self._params.model)
        except RosVisualiseError as error:
            return self._say(str(error))
        halves = (
            f", the two halves of the views differ by {found.halves.difference:.2%}"
            if found.halves
            else ""
        )
        fx, fy = found.fit.numbers[:2]
        return self._say(f"fx {fx:.1f}, fy {fy:.1f}, rms {found.fit.rms:.2f} px{halves}")

    @action("write the calibration to the file")
    def save(self, params: CalibratorParams) -> Image | None:
        """Save it to the file that the camera reads."""
        if self._found is None:
            return self._say("nothing to save yet: calibrate first")
        try:
            text = to_yaml(self._found.info, "camera", self._found.fit.covariance)
            save_again(path_of(params.file), text.encode())
        except RosVisualiseError as error:
            return self._say(str(error))
        return self._say(f"saved to {params.file}")

    @action("discard all views")
    def clear(self) -> Image | None:
        """Begin anew."""
        self._begin(self._params)
        return self._say("")

    def report(self) -> dict[str, Any]:
        """Views, what to do next, and the result."""
        found = self._found
        return {
            "found": self._collector.found,
            "views": len(self._collector.views),
            "next": self._collector.coverage.advice,
            "rms": found and round(found.fit.rms, 4),
            "K": found and found.info.K.ravel().tolist(),
            "D": found and found.info.D.tolist(),
        }

    def _begin(self, params: CalibratorParams) -> None:
        board = board_of(
            params.pattern, params.board, None, params.share or None, params.dictionary or None
        )
        self._collector = ViewCollector(board)
        self._found = self._view = None

    def _say(self, notice: str) -> Image | None:
        """The latest picture with a notice, which is logged too."""
        self._notice = notice
        if notice:
            log.info("calibrator: %s", notice)
        return None if self._latest is None else self._picture(self._latest)

    def _picture(self, image: Image) -> Image:
        """The picture, drawn on demand."""
        coverage = self._collector.coverage
        views = f"{len(self._collector.views)} views; {coverage.advice or 'everything is covered'}"
        lines = [self._notice, views] if self._notice else [views]
        draw = partial(_draw, image, self._view, coverage, lines)
        shape = (image.height, image.width, 3)
        return Image(Deferred(shape, np.uint8, draw), "bgr8", image.header)


def _draw(image: Image, *progress: Any) -> Any:
    return draw_progress(gray_of(image), *progress)


def _board(params: CalibratorParams) -> tuple[Any, ...]:
    """The parameters of the board."""
    return params.pattern, params.board, params.share, params.dictionary
