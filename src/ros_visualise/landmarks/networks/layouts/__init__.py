"""Output layouts of networks: a table of layouts, each with its decoder.

A layout is recognised by the file's metadata, the names of inputs and outputs, and their shapes.
``ALL`` are tried in this order; the first match is used. To add one, make an `OutputLayout` in a
file here and add it to ``ALL``.
"""

from ros_visualise.landmarks.networks.layouts.detr import DETR, RF_DETR, ULTRALYTICS_RT_DETR
from ros_visualise.landmarks.networks.layouts.layout import OutputLayout, Outputs, Signature
from ros_visualise.landmarks.networks.layouts.nanodet import NANODET_PLUS
from ros_visualise.landmarks.networks.layouts.own import OWN
from ros_visualise.landmarks.networks.layouts.yolo import YOLO_5, YOLO_8, YOLO_10
from ros_visualise.landmarks.networks.layouts.yolox import YOLOX

ALL = (OWN, DETR, RF_DETR, ULTRALYTICS_RT_DETR, YOLO_10, YOLO_8, YOLO_5, YOLOX, NANODET_PLUS)

__all__ = ["ALL", "OutputLayout", "Outputs", "Signature"]
