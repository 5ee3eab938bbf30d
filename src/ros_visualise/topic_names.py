"""What the topics of built-in nodes are called, where their names do not tell."""

from __future__ import annotations

from ros_visualise.nodes import NodeType

OUTPUTS = {
    "fps_control": {"image": "/controlled_stream"},
    "filters": {"image": "/processed_image"},
    "edge_detector": {"edges": "/edges", "edges_overlay": "/edges_overlay"},
    "rectify": {"image_rect": "/image_rect"},
    "calibrator": {"coverage": "/coverage"},
    "tag_detector": {"detections": "/detections", "debug_image": "/debug_image"},
    "landmark_detector": {
        "detections": "/detections",
        "debug_image": "/debug_image",
        "vision_info": "/vision_info",
    },
    "landmark_localizer": {
        "landmarks": "/landmarks",
        "markers": "/landmark_markers",
        "tf_static": "/landmarks/tf_static",
    },
    "landmark_navigator": {
        "pose": "/navigation/pose",
        "tf": "/navigation/tf",
        "landmarks": "/landmarks",
        "markers": "/landmark_markers",
        "diagnostics": "/navigation/diagnostics",
    },
    "pose_error": {"nees": "/nees", "error": "/position_error"},
}
"""Node -> output -> topic.

What a node gives to all of ROS on ``tf`` or ``tf_static`` has a topic of its own in one process,
where the node would hear itself.
"""

MADE = {topic for topics in OUTPUTS.values() for topic in topics.values()}
"""Topics that our nodes publish: recorded, they went through them once already."""

SOURCE_TOPICS = {
    "image": "/image_raw",
    "imu": "/imu/data",
    "mag": "/imu/mag",
    "truth": "/ground_truth/odom",
    "pad": "/ground_truth/pad",
}
"""Outputs of sources whose topics are not called as they are."""


def known_topics(declared: NodeType) -> dict[str, str] | None:
    """What a built-in node publishes: output -> topic; None where that follows from its name."""
    topics = OUTPUTS.get(declared.name, {})
    return topics if topics.keys() == declared.outputs.keys() else None
