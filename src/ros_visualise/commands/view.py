"""``view``: the page, or a recording, of pipelines that run on other machines."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from ros_visualise.commands import Command
from ros_visualise.core.errors import RosVisualiseError, UsageError
from ros_visualise.core.params import specs
from ros_visualise.running.arguments import option, parse_setting, positive
from ros_visualise.running.options import (
    MemoryOptions,
    NetworkOptions,
    OutputOptions,
    ViewingOptions,
)

if TYPE_CHECKING:
    from ros_visualise.runtime.recording import RecorderThread
    from ros_visualise.runtime.remote.runtime import RemoteRuntime

log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class ViewerOptions(NetworkOptions, ViewingOptions, OutputOptions, MemoryOptions):
    """Options of ``view``."""

    set: Sequence[str] = option(
        [],
        "set a parameter of a remote node, such as pipeline/filters.threshold=90; repeatable",
        metavar="NODE.PARAM=VALUE",
    )
    duration: float | None = option(None, "stop after S seconds", type=positive, metavar="S")


def run(options: ViewerOptions) -> int:
    """Show the topics of other machines until stopped."""
    import math
    import time
    from contextlib import closing

    from ros_visualise.core.printing import print_json
    from ros_visualise.core.signals import STOPPED, noticed
    from ros_visualise.running.interruptible import interruptible
    from ros_visualise.running.network import join
    from ros_visualise.running.play import view_options
    from ros_visualise.runtime.remote.runtime import RemoteRuntime
    from ros_visualise.runtime.report import to_json
    from ros_visualise.ui import open_view, watch

    logging.getLogger("ros_visualise").setLevel(logging.INFO)
    viewed = view_options(options, options.record_dir, "view")
    wait_s = options.duration or math.inf
    transport = interruptible(lambda: join(options, "viewer", wait_s))
    if transport is None:
        raise UsageError("give the address of a peer: --connect tcp/HOST:7447, or --listen")
    end_s = time.monotonic() + options.duration if options.duration else None
    with closing(transport), closing(RemoteRuntime(transport)) as runtime, noticed() as stop:
        pending = _Pending(options, runtime)

        def is_over() -> bool:
            pending.follow()
            return stop.asked or (end_s is not None and time.monotonic() > end_s)

        opening = lambda: open_view(options.view, viewed)  # noqa: E731
        watch(runtime, opening, is_over, reopens=options.view == "windows")
        pending.close()
        report = runtime.report()
        if options.json:
            print_json(to_json(report), default=str)
    return STOPPED if stop.asked else int(pending.failed)


class _Pending:
    """Settings and recordings that wait for their nodes and topics to come.

    Attributes:
        failed: data was lost, or a setting or recording rejected.
    """

    def __init__(self, options: ViewerOptions, runtime: RemoteRuntime) -> None:
        from ros_visualise.sinks.names import check_targets, parse_target
        from ros_visualise.sinks.parts import parse_split

        self.failed = False
        self._runtime, self._overwrite = runtime, options.overwrite
        self._split = parse_split(options.split) if options.split else None
        settings = map(parse_setting, options.set)
        self._settings = [(node.strip("/"), name, value) for node, name, value in settings]
        self._targets = [parse_target(text) for text in options.record]
        check_targets([path for path, _ in self._targets], None)
        self._recordings: list[RecorderThread] = []

    def follow(self) -> None:
        """Make the settings and start the recordings that have become possible."""
        nodes, topics = self._runtime.parameters, self._runtime.graph.topics
        for setting in tuple(self._settings):
            node, name, value = setting
            if node in nodes and specs(nodes[node].current):
                self._settings.remove(setting)
                self._attempt(partial(nodes[node].update, {name: value}))
        for target in tuple(self._targets):
            if topics and topics.keys() >= {*target[1]}:
                self._targets.remove(target)
                self._attempt(partial(self._record, *target))

    def close(self) -> None:
        """End the recordings; report missing nodes and topics."""
        for recording in self._recordings:
            self._runtime.stop_recording(recording)
            self.failed |= recording.error is not None
        missing = [node for node, _, _ in self._settings]
        missing += [str(path) for path, _ in self._targets]
        if missing:
            log.error("not found: %s", ", ".join(missing))
            self.failed = True

    def _record(self, path: Path, topics: Sequence[str]) -> None:
        started = self._runtime.start_recording(path, self._overwrite, topics, self._split)
        self._recordings.append(started)

    def _attempt(self, work: Callable[[], object]) -> None:
        try:
            work()
        except RosVisualiseError as error:
            log.error("%s", error)
            self.failed = True


COMMAND = Command("show pipelines running on other machines, over Zenoh", ViewerOptions, run)
