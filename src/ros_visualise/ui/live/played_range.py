"""The playback range as settings: saved once it differs from how it began, and set again."""

from __future__ import annotations

from collections.abc import Callable

from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.sources.playback import Playback
from ros_visualise.ui import Value
from ros_visualise.ui.live.clock import begin_at, end_at, seconds_of
from ros_visualise.ui.live.settings import Settings

_RANGE = "playback range"


def changed_range(playback: Playback) -> dict[str, Value]:
    """Place -> start and end of the range, s, if it differs from how it began; 0: no end."""
    part_s = playback.state.part_s
    if part_s == playback.first_part_s:
        return {}
    return {
        f"{_RANGE}/{name}": at or 0.0 for name, at in zip(("start", "end"), part_s, strict=True)
    }


def restore_range(playback: Playback, settings: Settings, note: Callable[[str], None]) -> None:
    """Set what waits for the range in the settings; ``note`` is called with each rejection."""
    for name, set_part in (("start", begin_at), ("end", end_at)):
        value = settings.pop(f"{_RANGE}/{name}")
        try:
            if value is not None:
                set_part(playback, seconds_of(float(value)))
        except (ValueError, RosVisualiseError) as error:
            note(f"{_RANGE}/{name}: {error}")
