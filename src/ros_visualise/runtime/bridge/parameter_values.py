"""The values that launch files and the command line of a graph give to declared parameters."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from enum import Enum
from typing import Any

from ros_visualise.core.errors import ParameterError
from ros_visualise.core.params import Spec, Value, specs

log = logging.getLogger(__name__)

_YAML_WORDS = {"True": ("on", "yes", "true", "y"), "False": ("off", "no", "false", "n")}
_NAMED = 5


def given_values(
    params: type, given: Mapping[str, Any], known: Iterable[str], where: str
) -> dict[str, Any]:
    """Those of declared parameters; what else is given is worth one warning.

    Args:
        params: the dataclass that declares them.
        given: name -> what stands there.
        known: other names that may stand there.
        where: what their names begin with on the graph.

    Raises:
        ParameterError: a value is of the wrong type or out of its range.
    """
    declared = {spec.name: spec for spec in specs(params)}
    names = [*declared, *known]
    unknown = [f"{where}{name}" for name in given if name not in names]
    if unknown:
        more = f" and {len(unknown) - _NAMED} more" if len(unknown) > _NAMED else ""
        text, there = ", ".join(unknown[:_NAMED]), ", ".join(names) or "none"
        log.warning("ignored unknown parameters: %s%s; known: %s", text, more, there)
    return {name: read(spec, given[name]) for name, spec in declared.items() if name in given}


def spelled(spec: Spec, value: Any) -> Any:
    """``off``, which YAML reads as a bool, for the choice that is called so."""
    words = _YAML_WORDS.get(str(value), ())
    return next((choice for choice in spec.choices if choice in words), value)


def read(spec: Spec, value: Any) -> Value:
    """The value of a parameter, as people, YAML and ROS write it.

    Raises:
        ParameterError: it is of the wrong type or out of its range.
    """
    if not isinstance(value, bool | int | float | str | Enum):
        raise ParameterError(f"{spec.name}={value}: must be a single value")
    return spec.coerce(spelled(spec, value))
