"""What a quadrotor is doing."""

from enum import Enum


class Mode(Enum):
    """What it is doing."""

    LANDED = "landed"
    FLYING = "flying"  # along a way, or hovering at its end
    COMMANDED = "commanded"
    LANDING = "landing"
    HOMING = "homing"  # over a target that it has seen, and down to it
