"""The ``metadata.yaml`` of a ROS 2 bag's folder."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from ros_visualise.yaml_files import BadYaml, load_yaml

log = logging.getLogger(__name__)

METADATA = "metadata.yaml"
CUSTOM = "custom_data"
"""Where it has texts of people's own; and what a record with them is called elsewhere."""


@dataclass(frozen=True)
class Metadata:
    """What a ``metadata.yaml`` says, as far as it can be read; None: nothing.

    ``compression_mode`` is empty, ``file`` or ``message``. ``custom``: texts by name that somebody
    gave when it was recorded, or after.
    """

    files: tuple[str, ...] = ()
    messages: int | None = None
    compression_mode: str | None = None
    custom: Mapping[str, str] = field(default_factory=dict)


def read_metadata(folder: Path) -> Metadata:
    """What a folder's says; that it is missing or cannot be read is logged."""
    path = folder / METADATA
    try:
        content = load_yaml(path)
        about = content["rosbag2_bagfile_information"]
        names = tuple(map(str, about.get("relative_file_paths") or ()))
        mode = str(about.get("compression_mode") or "").lower().replace("none", "")
        messages = about.get("message_count")
        custom = {str(key): str(text) for key, text in (about.get(CUSTOM) or {}).items()}
    except FileNotFoundError:
        log.warning("%s: %s is missing; the files tell what it would say", folder, METADATA)
    except BadYaml as error:
        log.warning("%s: cannot be read: %s; the files tell what it would say", path, error)
    except (OSError, KeyError, TypeError, AttributeError):
        log.warning("%s: cannot be read; the files tell what it would say", path)
    else:
        return Metadata(names, messages if isinstance(messages, int) else None, mode, custom)
    return Metadata()
