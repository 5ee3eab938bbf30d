"""How the outputs of networks are to be read: a table of layouts, with a decoder each.

A layout is recognised by what the file says of itself, by the names of inputs and outputs, and by
their shapes. ``ALL`` are tried in this order, so that the first that fits is taken. A new one is a
file here that makes a `OutputLayout`, and its place in ``ALL``.
"""

from ros_visualise.landmarks.networks.layouts.detr import DETR, RF_DETR, ULTRALYTICS_RT_DETR
from ros_visualise.landmarks.networks.layouts.layout import OutputLayout, Outputs, Signature
from ros_visualise.landmarks.networks.layouts.nanodet import NANODET_PLUS
from ros_visualise.landmarks.networks.layouts.own import OWN
from ros_visualise.landmarks.networks.layouts.yolo import YOLO_5, YOLO_8, YOLO_10
from ros_visualise.landmarks.networks.layouts.yolox import YOLOX

ALL = (OWN, DETR, RF_DETR, ULTRALYTICS_RT_DETR, YOLO_10, YOLO_8, YOLO_5, YOLOX, NANODET_PLUS)

__all__ = ["ALL", "OutputLayout", "Outputs", "Signature"]
