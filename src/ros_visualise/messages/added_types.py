"""Message types that the library which reads and writes messages does not know by itself."""

from __future__ import annotations

_TF = {"tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms"}

_BOX_2D = "center\nfloat64 size_x\nfloat64 size_y"
_BOX_3D = "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size"
_RESULTS = "std_msgs/Header header\nObjectHypothesisWithPose[] results\n"
_POSE = "geometry_msgs/PoseWithCovariance pose"

_VISION = {
    "vision_msgs/msg/VisionInfo": (
        "std_msgs/Header header\nstring method\nstring database_location\nint32 database_version"
    ),
    "vision_msgs/msg/BoundingBox3D": _BOX_3D,
    "vision_msgs/msg/Detection2DArray": "std_msgs/Header header\nDetection2D[] detections",
    "vision_msgs/msg/Detection3DArray": "std_msgs/Header header\nDetection3D[] detections",
}

_VISION_1 = {
    "vision_msgs/msg/ObjectHypothesis": "int64 id\nfloat64 score",
    "vision_msgs/msg/ObjectHypothesisWithPose": f"int64 id\nfloat64 score\n{_POSE}",
    "vision_msgs/msg/BoundingBox2D": f"geometry_msgs/Pose2D {_BOX_2D}",
    "vision_msgs/msg/Detection2D": f"{_RESULTS}BoundingBox2D bbox\nsensor_msgs/Image source_img",
    "vision_msgs/msg/Detection3D": (
        f"{_RESULTS}BoundingBox3D bbox\nsensor_msgs/PointCloud2 source_cloud"
    ),
}
"""Of vision_msgs 0.0.2, for ROS 1."""

_VISION_2 = {
    "vision_msgs/msg/Point2D": "float64 x\nfloat64 y",
    "vision_msgs/msg/Pose2D": "vision_msgs/Point2D position\nfloat64 theta",
    "vision_msgs/msg/ObjectHypothesis": "string class_id\nfloat64 score",
    "vision_msgs/msg/ObjectHypothesisWithPose": f"ObjectHypothesis hypothesis\n{_POSE}",
    "vision_msgs/msg/BoundingBox2D": f"vision_msgs/Pose2D {_BOX_2D}",
    "vision_msgs/msg/Detection2D": f"{_RESULTS}BoundingBox2D bbox\nstring id",
    "vision_msgs/msg/Detection3D": f"{_RESULTS}BoundingBox3D bbox\nstring id",
}
"""Of vision_msgs 4, for ROS 2 from Humble on."""

ADDED_TYPES = {"ros1": {**_TF, **_VISION_1, **_VISION}, "cdr": {**_VISION_2, **_VISION}}
"""Encoding -> type name -> its definition."""
