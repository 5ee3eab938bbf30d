"""How a page is arranged, as a file holds it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from ros_visualise.core.errors import OpenError
from ros_visualise.core.yaml_files import BadYaml, load_yaml

Value = bool | int | float | str
Arrangement = Mapping[str, Value]
"""Place of an element, such as ``filters/threshold`` or ``windows/path`` -> its value."""


def read_arrangement(path: Path) -> Arrangement:
    """The arrangement in a YAML file that the page has saved.

    Raises:
        OpenError: there is no such file, or it holds something else.
    """
    try:
        found = load_yaml(path) or {}
    except OSError as error:
        raise OpenError(f"{path}: {error.strerror}; give a file that 'save layout' wrote") from None
    except BadYaml as error:
        raise OpenError(f"{path}: not YAML: {error}") from None
    is_one = isinstance(found, dict) and all(isinstance(name, str) for name in found)
    if not is_one or not all(isinstance(value, Value) for value in found.values()):
        raise OpenError(f"{path}: must hold lines PLACE: VALUE, such as windows/path: false")
    return dict(found)
