"""Transforms between frames, as tf carries them."""

from __future__ import annotations

from dataclasses import dataclass

from ros_visualise.data.header import Floats, Header, keep


@dataclass(frozen=True, eq=False)
class TransformStamped:
    """Where the frame ``child_frame_id`` is in the frame of the header: T_parent_child.

    ``translation_xyz`` (3,) in metres and ``quat_xyzw`` (4,) take points of the child frame to the
    frame of the header.
    """

    child_frame_id: str
    translation_xyz: Floats
    quat_xyzw: Floats
    header: Header = Header()

    def __post_init__(self) -> None:
        keep(self, translation_xyz=(3,), quat_xyzw=(4,))


@dataclass(frozen=True, eq=False)
class Transforms:
    """Several transforms that were sent at once, as on ``/tf``."""

    transforms: tuple[TransformStamped, ...]

    @property
    def header(self) -> Header:
        """That of the first; of none, an empty one."""
        return self.transforms[0].header if self.transforms else Header()
