"""The ``metadata.yaml`` of a ROS 2 bag's folder."""

from __future__ import annotations

import logging
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ros_visualise.core.yaml_files import BadYaml, load_yaml

log = logging.getLogger(__name__)

METADATA = "metadata.yaml"
CUSTOM = "custom_data"
"""Name of its private texts, and of a record with them in other formats."""


@dataclass(frozen=True)
class Metadata:
    """Content of a ``metadata.yaml``, as far as it can be read; None: missing.

    ``compression_mode`` is empty, ``file`` or ``message``. ``custom``: texts by name, given when or
    after it was recorded. ``by_topic`` and ``by_file``: counts of messages, if any. ``damaged``:
    why it cannot be read, if it exists.
    """

    files: tuple[str, ...] = ()
    messages: int | None = None
    compression_mode: str | None = None
    custom: Mapping[str, str] = field(default_factory=dict)
    by_topic: Mapping[str, int] = field(default_factory=dict)
    by_file: Mapping[str, int] = field(default_factory=dict)
    damaged: str = ""


def read_metadata(folder: Path) -> Metadata:
    """Metadata of a folder; a missing file is logged."""
    path = folder / METADATA
    try:
        return _parse(load_yaml(path)["rosbag2_bagfile_information"])
    except FileNotFoundError:
        log.warning("%s: %s is missing; reading the files without it", folder, METADATA)
        return Metadata()
    except BadYaml as error:
        why = f"cannot be read: {error}"
    except (OSError, KeyError, TypeError, AttributeError, ValueError):
        why = "cannot be read"
    return Metadata(damaged=f"{METADATA}: {why}; reading the files without it")


def _parse(about: Any) -> Metadata:
    messages = about.get("message_count")
    topics = about.get("topics_with_message_count") or ()
    return Metadata(
        files=tuple(map(str, about.get("relative_file_paths") or ())),
        messages=None if messages is None else _count(messages),
        compression_mode=str(about.get("compression_mode") or "").lower().replace("none", ""),
        custom={str(key): str(text) for key, text in (about.get(CUSTOM) or {}).items()},
        by_topic={str(t["topic_metadata"]["name"]): _count(t["message_count"]) for t in topics},
        by_file={
            re.split(r"[/\\]", str(one["path"]))[-1]: _count(one["message_count"])
            for one in about.get("files") or ()
        },
    )


def _count(value: Any) -> int:
    if not isinstance(value, int):
        raise TypeError(f"{value!r} is not a valid message count")
    return value
