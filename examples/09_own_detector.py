"""A detector of your own, whose boxes are drawn over the image: blobs of one brightness.

ros-visualise video flight.mp4 --node examples/09_own_detector.py:blobs@fps_control
"""

from dataclasses import dataclass

import cv2
import numpy as np

from ros_visualise.data import Detection, Detections, Hypothesis, Image
from ros_visualise.nodes import node, param


@dataclass(frozen=True)
class BlobParams:
    area: int = param(150, "least area, pixels", min=10, max=100_000)
    roundness: float = param(0.5, "least roundness; 1 is a circle", min=0, max=1)


@node("blobs", params=BlobParams, inputs={"image": Image}, outputs={"detections": Detections})
def blobs(image: Image, params: BlobParams) -> Detections:
    """Finds blobs by OpenCV."""
    settings = cv2.SimpleBlobDetector_Params()
    settings.filterByArea, settings.minArea, settings.maxArea = True, params.area, 1e6
    settings.filterByCircularity, settings.minCircularity = True, params.roundness
    found = cv2.SimpleBlobDetector_create(settings).detect(image.pixels)
    return Detections(
        tuple(
            Detection(
                hypotheses=(Hypothesis("blob", 1.0),),
                center_uv=np.array(point.pt),
                size_uv=np.full(2, point.size),
            )
            for point in found
        ),
        header=image.header,
    )
