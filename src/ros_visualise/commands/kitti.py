"""``kitti``: a drive of the KITTI data set, played as a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ros_visualise.commands import Command
from ros_visualise.commands.bag import BagOptions, run
from ros_visualise.running.arguments import argument


@dataclass(frozen=True, kw_only=True)
class KittiOptions(BagOptions):
    """Options of ``kitti``."""

    input: Sequence[str] = argument(
        "folder of a drive, or of a date that contains only one drive", metavar="DIR", nargs="+"
    )


COMMAND = Command("play a drive of the KITTI data set", KittiOptions, run)
