"""Parameters shared by the nodes that map landmarks or navigate by them."""

from __future__ import annotations

from dataclasses import dataclass

from ros_visualise.core.params import param


@dataclass(frozen=True)
class MapParams:
    """Parameters of the map and its landmarks."""

    map: str = param(
        "", "YAML file of the initial landmarks, as written by save_map", group="map", file=bool
    )
    save_to: str = param("landmarks.yaml", "YAML file that save_map writes", group="map", file=bool)
    class_prefix: str = param(
        "landmark_",
        "prefix for tag classes that are bare numbers (as they are on ROS 1), such as tag36h11_",
        group="map",
    )
    object_prefix: str = param(
        "object_", "prefix for numeric classes of other objects", group="map"
    )
    moving: str = param(
        "",
        "classes of moving objects, such as pad, person; they are not used as landmarks",
        group="map",
    )
    ground: bool = param(
        True, "place objects of unknown distance, such as posts, on the ground", group="ground"
    )
    ground_height: float = param(
        0.0, "height of the ground, metres", min=-1e4, max=1e4, slider=(-10, 10), group="ground"
    )
    ground_sigma: float = param(
        0.1,
        "standard deviation of the ground height, metres",
        min=1e-3,
        max=1e3,
        slider=(0.01, 5),
        group="ground",
    )

    @property
    def moving_classes(self) -> frozenset[str]:
        """The classes in `moving`."""
        return frozenset(name.strip() for name in self.moving.split(",")) - {""}
