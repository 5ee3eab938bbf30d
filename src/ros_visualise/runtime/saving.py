"""Files of parameters: those of nodes are saved as YAML, and loaded."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from datetime import datetime
from itertools import count
from pathlib import Path
from typing import Any

from ros_visualise.core.errors import OpenError, UsageError
from ros_visualise.core.params import Parameters, plain_of, specs
from ros_visualise.core.yaml_files import open_yaml, to_yaml
from ros_visualise.runtime.base import Runtime
from ros_visualise.sinks.files import write_file

_FORM = "give a YAML file as NODE: {PARAM: VALUE}"


def live_parameters(runtime: Runtime) -> dict[str, Parameters[Any]]:
    """The parameters of the present nodes, by their names."""
    names = [member.name for member in runtime.graph.members]
    return {name: runtime.parameters[name] for name in names if name in runtime.parameters}


def save(parameters: Mapping[str, Parameters[Any]], path: Path) -> None:
    """Write the present values of parameters to a new file.

    Args:
        parameters: by the name of their node; each ``/`` in it makes a nested mapping.
        path: of the file.

    Raises:
        UsageError: its name does not end in .yaml, or nothing can be saved.
        OpenError: it exists, or cannot be written.
        RecordingError: it could not be written to its end.
    """
    values = _values(parameters)
    if not values:
        raise UsageError("no node has parameters to save")
    write_yaml(values, path)


def write_yaml(values: Mapping[str, Any], path: Path) -> None:
    """Write values to a new file; raises as `save`."""
    if path.suffix != ".yaml":
        raise UsageError(f"{path.name}: give a name that ends in .yaml")
    write_file(path, to_yaml(values).encode())


def save_anew(parameters: Mapping[str, Parameters[Any]], folder: Path) -> Path:
    """Write as `save` does, to a file with a new name; returns its path."""
    first = folder.absolute() / new_name()
    for number in count(1):
        path = first if number == 1 else first.with_stem(f"{first.stem}-{number}")
        try:
            save(parameters, path)
            return path
        except OpenError:
            if not path.exists():
                raise
    raise AssertionError


def new_name(what: str = "parameters") -> str:
    """A file name with the present time, as of a recording."""
    return f"{what}-{datetime.now():%Y%m%d-%H%M%S}.yaml"


def _values(parameters: Mapping[str, Parameters[Any]]) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for node, live in parameters.items():
        current = live.current
        saved = [spec.name for spec in specs(current) if spec.saved]
        place = values
        for part in node.split("/") if saved else ():
            place = place.setdefault(part, {})
        place |= {name: plain_of(getattr(current, name)) for name in saved}
    return values


def load(path: Path) -> dict[str, dict[str, Any]]:
    """The values in a file of parameters, by the names of nodes.

    Raises:
        OpenError: it cannot be read, or holds something else.
    """
    values = open_yaml(path, _FORM)
    values = {} if values is None else values
    if not isinstance(values, dict) or not all(isinstance(v, dict) for v in values.values()):
        raise OpenError(f"{path}: must hold NODE: {{PARAM: VALUE}}")
    for key in _keys(values):
        if not isinstance(key, str):
            raise OpenError(
                f"{path}: {_as_yaml(key)} is not a name; must hold NODE: {{PARAM: VALUE}}"
            )
    return values


def _keys(values: Mapping[Any, Any]) -> Iterator[Any]:
    for key, value in values.items():
        yield key
        if isinstance(value, dict):
            yield from _keys(value)


def _as_yaml(key: Any) -> str:
    return "null" if key is None else repr(key)


def of_node(values: Mapping[str, Any], name: str) -> dict[str, Any]:
    """The values of one node in a file of parameters.

    Args:
        values: of the file, see `load`; a node may be in a mapping of its namespace, and its values
            below ``ros__parameters``, as in ROS 2.
        name: of the node, with its namespace.
    """
    found_values: dict[str, Any] = {}
    words = name.strip("/").split("/")
    for first in reversed(range(len(words))):
        found: Any = values
        for word in words[first:]:
            found = found.get(word) if isinstance(found, dict) else None
        if isinstance(found, dict):
            found_values |= found.get("ros__parameters", found)
    return {name: value for name, value in found_values.items() if not isinstance(value, dict)}
