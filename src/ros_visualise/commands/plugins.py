"""``plugins``: the plug-ins of other packages, and those that failed to load."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

from ros_visualise.commands import COMMANDS, Command
from ros_visualise.core.printing import escaped, print_json, print_result
from ros_visualise.core.registry import GROUP, Plugin, Registry, unknown_groups
from ros_visualise.running.arguments import option


@dataclass(frozen=True)
class PluginsOptions:
    """Options of ``plugins``."""

    json: bool = option(False, "print the list as one JSON array")


def run(options: PluginsOptions) -> int:
    """List the plug-ins; the exit status is 1 if one cannot be used."""
    from ros_visualise.estimation.sensors import SENSORS as MEASUREMENTS
    from ros_visualise.lessons import LESSONS
    from ros_visualise.nodes import NODES
    from ros_visualise.simulation.robots import ROBOTS
    from ros_visualise.simulation.sensors import SENSORS
    from ros_visualise.simulation.worlds import WORLDS
    from ros_visualise.sources.formats import FORMATS
    from ros_visualise.ui.scene.drawings import DRAWINGS
    from ros_visualise.ui.shell.panels import PANELS

    registries: tuple[Registry[Any], ...]
    registries = (NODES, FORMATS, DRAWINGS, PANELS, LESSONS, ROBOTS, SENSORS, WORLDS)
    registries += (MEASUREMENTS, COMMANDS)
    found = [_described(registry, one) for registry in registries for one in registry.plugins()]
    known = [registry.kind for registry in registries]
    for group, package in unknown_groups(known):
        why = f"unknown group {group}; choose from {', '.join(GROUP + kind for kind in known)}"
        found.append({"kind": "?", "name": "*", "package": package, "failure": why})
    if options.json:
        print_json(found)
    else:
        print_result(_lines(found))
    return int(any(one["failure"] for one in found))


def _described(registry: Registry[Any], plugin: Plugin) -> dict[str, str]:
    return {**asdict(plugin), "failure": registry.failure(plugin)}


def _lines(found: list[dict[str, str]]) -> Iterator[str]:
    if not found:
        yield "no plug-ins installed; for an example, see examples/plugin in the repository"
    for one in found:
        whose = f"{one['package']} {one.get('version', '')}".strip()
        state = f": {one['failure']}" if one["failure"] else ""
        yield escaped(f"{one['kind']:<10} {one['name']:<20} {whose}{state}")


COMMAND = Command(
    "list the plug-ins of other packages, and those that failed to load", PluginsOptions, run
)
