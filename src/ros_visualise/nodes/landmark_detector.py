"""The node that detects objects with a neural network, and their directions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ros_visualise.core.errors import OpenError, UncalibratedCamera, UnsupportedImage
from ros_visualise.core.params import param
from ros_visualise.data import Deferred, Detection, Detections, Image, VisionInfo
from ros_visualise.landmarks.drawing import draw_detections
from ros_visualise.landmarks.networks.candidates import Candidates, SelectionRules
from ros_visualise.landmarks.networks.finding import GroundPoint, GroundPointRule, to_detections
from ros_visualise.landmarks.networks.names import load_names, numbers_of
from ros_visualise.landmarks.networks.network import Network
from ros_visualise.landmarks.networks.session import Provider
from ros_visualise.landmarks.networks.tiles import detect_in_tiles
from ros_visualise.landmarks.once_log import OnceLog
from ros_visualise.nodes import node
from ros_visualise.vision import color
from ros_visualise.vision.threads import fit_threads

OWN_MODEL = Path(__file__).parents[1] / "landmarks" / "networks" / "models" / "aerial.onnx"
"""The network of this project: the default."""


@dataclass(frozen=True)
class LandmarkParams:
    """Parameters of `landmark_detector`."""

    model: str = param(
        "",
        "ONNX file of a detection network; empty: the built-in one, for helipads, tags, posts"
        " and vehicles seen from the air",
        restart=True,
        file=bool,
    )
    names: str = param(
        "",
        "text file with one class name per line; empty: the names in the network's file",
        restart=True,
        file=bool,
    )
    classes: str = param(
        "", "names or numbers of the classes to detect, such as helipad, 7; empty: all"
    )
    min_score: float = param(0.6, "lowest score of a detection, 0 to 1", min=0, max=1)
    max_overlap: float = param(
        0.5,
        "overlap above which two boxes of the same class are merged, as a fraction; for networks"
        " that report an object several times",
        min=0,
        max=1,
        group="choice",
    )
    max_detections: int = param(
        100,
        "largest number of detections in one image; the best are kept",
        min=1,
        max=1_000,
        slider=(1, 300),
    )
    tile: int = param(
        0,
        "size of tiles, pixels: a large image is also searched at full resolution, in overlapping"
        " tiles of this size; 640 suits our own network; 0: off",
        min=0,
        max=4096,
        slider=(0, 1280),
    )
    stands_on: GroundPoint = param(
        GroundPoint.BOTTOM,
        "where in its box an object touches the ground, if the network does not report the point:"
        " the middle of the lower side, or the centre (for views from above)",
        group="direction",
    )
    box_sigma: float = param(
        0.1,
        "standard deviation of the point on the ground, as a fraction of the box's width and"
        " height",
        min=0.001,
        max=1,
        slider=(0.01, 0.5),
        group="direction",
    )
    input_size: int = param(
        0,
        "longer side of the network's input, pixels, for networks that take any size; 0: the"
        " file's default, or 640",
        min=0,
        max=4096,
        restart=True,
    )
    provider: Provider = param(
        Provider.CPU, "device that the network runs on; cuda needs onnxruntime-gpu", restart=True
    )
    threads: int = param(
        2,
        "number of threads per image; more threads are faster, but slow down other nodes",
        min=1,
        max=64,
        restart=True,
    )
    database_location: str = param(
        "",
        "where other nodes find the class names, such as a ROS parameter; published on"
        " vision_info; empty: the path of the names file, or else of the network's file",
        restart=True,
    )


@node(
    "landmark_detector",
    params=LandmarkParams,
    inputs={"image": Image},
    outputs={"detections": Detections, "debug_image": Image, "vision_info": VisionInfo},
    on_demand=("debug_image",),
    latched=("vision_info",),
    calibrated=True,
)
class LandmarkDetector:
    """Detects objects with a neural network (ONNX); with a calibration, their directions too."""

    def __init__(self, params: LandmarkParams) -> None:
        self._remarks = OnceLog("landmark_detector")
        self._opened: tuple[str | int | Provider, ...] = ()
        self._published: dict[int, str] | None = None
        self._version = 0
        self._prepare(params)

    def step(self, image: Image, params: LandmarkParams) -> dict[str, Any]:
        if params is not self._params:
            self._prepare(params)
        color.refuse_measurements(image.encoding)
        fit_threads(image.pixels)
        pixels, order = (
            color.demosaiced(image.pixels, image.encoding),
            color.order_of(image.encoding),
        )
        candidates = detect_in_tiles(self._network, pixels, order, self._choice, params.tile)
        found = self._locate(candidates, image)
        size = (image.height, image.width, 3)
        shown = Deferred(size, np.uint8, lambda: draw_detections(pixels, order, found))
        return {
            "detections": Detections(
                found, image.header, image.camera_info, (image.width, image.height)
            ),
            "debug_image": replace(image, data=shown, encoding="bgr8"),
            "vision_info": self._vision_info(image),
        }

    def _prepare(self, params: LandmarkParams) -> None:
        """Apply parameters; if they are rejected, the former ones stay."""
        self._params = params
        opened = (params.model, params.provider, params.threads, params.input_size)
        if opened != self._opened:
            self._network = Network(
                _file_of(params.model), params.provider, params.threads, params.input_size
            )
            self._opened = opened
        self._names = load_names(params.names) if params.names else self._network.names
        classes = numbers_of(params.classes, self._names)
        self._choice = SelectionRules(
            params.min_score, params.max_overlap, params.max_detections, classes
        )

    def _vision_info(self, image: Image) -> VisionInfo | None:
        """The names of the classes, if they are new."""
        if self._names == self._published:
            return None
        self._published, self._version = self._names, self._version + 1
        params = self._params
        file = Path(_file_of(params.model))
        place = params.database_location or params.names or str(file)
        method = f"{self._network.layout.name} {file.name}"
        return VisionInfo(method, place, self._version, image.header)

    def _locate(self, found: Candidates, image: Image) -> tuple[Detection, ...]:
        """Detections with directions, or without and once a warning."""
        params, info = self._params, image.camera_info
        stand = GroundPointRule(params.stands_on, params.box_sigma)
        if info and (info.width, info.height) != (image.width, image.height):
            size, of_info = f"{image.width}x{image.height}", f"{info.width}x{info.height}"
            self._remarks.say(
                f"detections have no directions: images are {size}, their calibration is"
                f" for {of_info}"
            )
            info = None
        try:
            return to_detections(found, self._names, stand, info)
        except (UncalibratedCamera, UnsupportedImage) as error:
            self._remarks.say(f"detections have no directions: {error}")
            return to_detections(found, self._names, stand, None)


def _file_of(model: str) -> str:
    """The file of a network.

    Raises:
        OpenError: none is given, and our own is not installed.
    """
    if not model and not OWN_MODEL.is_file():
        raise OpenError("landmark_detector: give an ONNX file with model=FILE.onnx")
    return model or str(OWN_MODEL)
