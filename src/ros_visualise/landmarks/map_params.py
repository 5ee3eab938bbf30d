"""What nodes that map landmarks, or find their way by them, have to be told alike."""

from __future__ import annotations

from dataclasses import dataclass

from ros_visualise.core.params import param


@dataclass(frozen=True)
class MapParams:
    """Parameters of the map and of what belongs into it."""

    map: str = param(
        "", "YAML file of landmarks to begin with, as save_map writes it", group="map", file=bool
    )
    save_to: str = param(
        "landmarks.yaml", "YAML file that save_map writes the landmarks to", group="map", file=bool
    )
    class_prefix: str = param(
        "landmark_",
        "what is put before a tag's class that is only a number, as on ROS 1, such as tag36h11_",
        group="map",
    )
    object_prefix: str = param(
        "object_",
        "what is put before the class of another object that is only a number",
        group="map",
    )
    moving: str = param(
        "", "classes that move, so that they are no landmarks, such as pad, person", group="map"
    )
    ground: bool = param(
        True, "place objects of unknown distance, such as posts, on the ground", group="ground"
    )
    ground_height: float = param(
        0.0,
        "height of the ground, metres",
        min=-1e4,
        max=1e4,
        slider=(-10, 10),
        group="ground",
    )
    ground_sigma: float = param(
        0.1,
        "standard deviation of that height, metres",
        min=1e-3,
        max=1e3,
        slider=(0.01, 5),
        group="ground",
    )

    @property
    def moving_classes(self) -> frozenset[str]:
        """The classes in `moving`."""
        return frozenset(name.strip() for name in self.moving.split(",")) - {""}
