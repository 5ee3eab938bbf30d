"""The node that detects tags, and their poses."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ros_visualise.core.params import param
from ros_visualise.data import CameraInfo, Deferred, Detections, Image
from ros_visualise.landmarks.drawing import draw_detections
from ros_visualise.landmarks.once_log import OnceLog
from ros_visualise.landmarks.pose import CornerErrors
from ros_visualise.landmarks.tags import TagFinder, parse_families
from ros_visualise.landmarks.tags.known import KnownTags, parse_ids, read_known_tags
from ros_visualise.landmarks.tags.locating import locate_or_remark
from ros_visualise.landmarks.tags.pose_params import PoseParams
from ros_visualise.landmarks.tags.search import TagSearch
from ros_visualise.landmarks.tags.shutter import RollingShutter
from ros_visualise.nodes import node
from ros_visualise.vision import color
from ros_visualise.vision.depth import to_8_bit
from ros_visualise.vision.threads import fit_threads


@dataclass(frozen=True)
class TagParams(PoseParams):
    """Parameters of `tag_detector`."""

    families: str = param(
        "tag36h11", "tag families to detect, such as tag36h11, tagStandard41h12, 5x5_1000"
    )
    quad_decimate: float = param(
        1.0,
        "factor by which the image is reduced to detect squares: faster, but misses small tags",
        min=1,
        max=8,
        slider=(1, 4),
        group="search",
    )
    quad_sigma: float = param(
        0.0,
        "standard deviation of the blur before squares are detected, pixels; values below 0"
        " sharpen: -0.8 detects smaller tags, but takes 1.5 times as long",
        min=-3,
        max=3,
        slider=(-2, 2),
        group="search",
    )
    search_every: int = param(
        1,
        "search only every n-th image as a whole, and the others around the last tags; 1 searches"
        " every image as a whole; 5 is faster, and suits video",
        min=1,
        max=100,
        slider=(1, 30),
        group="search",
    )
    refine: bool = param(
        True, "refine the corners by fitting the sides of the squares to the image", group="search"
    )
    min_margin: float = param(
        0.0,
        "minimum contrast of a cell: gray levels from the middle between black and white; some"
        " families need more",
        min=0,
        max=127,
        group="search",
    )


@node(
    "tag_detector",
    params=TagParams,
    inputs={"image": Image},
    outputs={"detections": Detections, "debug_image": Image},
    on_demand=("debug_image",),
    calibrated=True,
)
class TagDetector:
    """Detects AprilTag and ArUco tags, with their poses if the camera is calibrated."""

    def __init__(self, params: TagParams) -> None:
        self._search = TagSearch()
        self._shutter = RollingShutter()
        self._remarks = OnceLog("tag_detector")
        self._prepare(params)

    def reset(self) -> None:
        self._search.reset()
        self._shutter.reset()

    def step(self, image: Image, params: TagParams) -> dict[str, Image | Detections]:
        if params is not self._params:
            self._prepare(params)
        color.refuse_measurements(image.encoding)
        fit_threads(image.pixels)
        pixels = color.demosaiced(image.pixels, image.encoding)
        order = color.order_of(image.encoding)
        gray = to_8_bit(color.to_gray(pixels, order))
        info = self._calibration(image)
        every = self._search.find(self._finder, gray, params.search_every, info)
        tags = self._known.present(every, image.header.stamp_ns, self._ignored)
        tags = self._shutter.at_stamp(tags, image.header.stamp_ns, image.height, params.readout)
        found = locate_or_remark(
            tags, self._known, params.size, info, params.camera, self._errors, self._remarks
        )
        shown = Deferred((*gray.shape, 3), np.uint8, lambda: draw_detections(pixels, order, found))
        return {
            "detections": Detections(
                found, image.header, image.camera_info, (image.width, image.height)
            ),
            "debug_image": replace(image, data=shown, encoding="bgr8"),
        }

    def _prepare(self, params: TagParams) -> None:
        families = parse_families(params.families)
        self._ignored = parse_ids(params.ignore)
        self._known = read_known_tags(params.tags) if params.tags else KnownTags()
        self._finder = TagFinder(
            families, params.quad_decimate, params.quad_sigma, params.refine, params.min_margin
        )
        self._errors = CornerErrors(params.corner_floor)
        self._params = params
        self._search.reset()

    def _calibration(self, image: Image) -> CameraInfo | None:
        """The calibration of the image; None, and once a warning, if it is for another size."""
        info = image.camera_info
        if info and (info.width, info.height) != (image.width, image.height):
            size, of_info = f"{image.width}x{image.height}", f"{info.width}x{info.height}"
            self._remarks.say(f"no poses: images are {size}, their calibration is for {of_info}")
            return None
        return info
