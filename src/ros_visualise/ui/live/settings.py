"""Parameters that differ from how they began, and those of an address or a file to set again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from ros_visualise.core.params import Parameters, Spec, specs
from ros_visualise.ui import Value
from ros_visualise.ui.live.declared import label_of, sent, sentence

_MOST_WAITING = 1000
_RENAMED = {
    "part": "playback range",
    "from": "start",
    "to": "end",
    "looks": "appearance",
    "points at most": "max points",
    "axes of frames": "frame axes",
    "names of frames": "frame names",
    "follow the robot": "follow robot",
}
"""Names in addresses and layout files of the last release, and those of today in lower case."""


def by_name(wanted: Mapping[str, Value]) -> dict[str, Value]:
    """Place, as it is called today -> value."""
    return {
        "/".join(_RENAMED.get(part, part) for part in place.casefold().split("/")): value
        for place, value in wanted.items()
    }


class Settings:
    """Knows the first values of all parameters, from one graph to the next.

    A place is ``node/parameter``, or as the page names them: ``node/Group/Label``, in any case. A
    value waits until its node exists.
    """

    def __init__(self, wanted: Mapping[str, Value]) -> None:
        self._first: dict[str, Mapping[str, Any]] = {}
        self._waiting: dict[str, Value] = {}
        self.want(wanted)

    def want(self, wanted: Mapping[str, Value]) -> None:
        """Set these values by the next `take`."""
        for place, value in by_name(wanted).items():
            if len(self._waiting) < _MOST_WAITING:
                self._waiting[place] = value

    def first(self, node: str) -> Mapping[str, Any]:
        """The first values of a node, as they are sent."""
        return self._first.get(node, {})

    def meet(self, node: str, parameters: Parameters[Any]) -> None:
        """Note the first values of a node."""
        current = parameters.current
        now = {spec.name: sent(getattr(current, spec.name)) for spec in shown_specs(current)}
        self._first[node] = now | dict(self._first.get(node, {}))

    def changed(self, node: str, parameters: Parameters[Any]) -> dict[str, Any]:
        """The values of a node that differ from the first ones."""
        current = parameters.current
        now = {spec.name: sent(getattr(current, spec.name)) for spec in shown_specs(current)}
        return {name: value for name, value in now.items() if value != self.first(node).get(name)}

    def pop(self, place: str) -> Value | None:
        """The value that waits for a place, which waits no longer."""
        return self._waiting.pop(place, None)

    def take(self, node: str, parameters: Parameters[Any]) -> dict[str, Value]:
        """The values that wait for a node; they wait no longer."""
        return {
            spec.name: self._waiting.pop(place)
            for spec in shown_specs(parameters.current)
            for place in _places(node, spec)
            if place in self._waiting
        }


def shown_specs(params: Any) -> list[Spec]:
    """The parameters that can be set while a node runs."""
    return [spec for spec in specs(params) if not spec.restart]


def _places(node: str, spec: Spec) -> Iterator[str]:
    yield f"{node}/{spec.name}".casefold()
    folder = f"{node}/{sentence(spec.group)}" if spec.group else node
    yield f"{folder}/{label_of(spec)}".casefold()
