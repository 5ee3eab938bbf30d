"""``demo``, ``video``, ``camera``: playing a source through the nodes, with a view of it."""

from __future__ import annotations

import json
import logging
import signal
import sys
from argparse import Namespace
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from ros_visualise import nodes as registry
from ros_visualise.commands.interruptible import interruptible
from ros_visualise.errors import OpenError, ParameterError, RosVisualiseError, UsageError
from ros_visualise.pipelines import Graph, image_pipeline, parse_node
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.runtime.recording import RecorderThread
from ros_visualise.sinks import parse_target
from ros_visualise.sources.playback import Playback
from ros_visualise.ui import View, open_view

_SPIN_S = 0.05


def run(args: Namespace) -> int:
    """Play a source until it ends or a person ends it."""
    return _play(args, **_SETTINGS[args.command](args))


def _demo(args: Namespace) -> dict[str, Any]:
    return {}


def _video(args: Namespace) -> dict[str, Any]:
    return {"path": args.input}


def _camera(args: Namespace) -> dict[str, Any]:
    if args.rate is not None or args.loop or args.start is not None:
        raise UsageError("a camera is live: it takes no --rate, --loop or --start")
    return {"uri": args.input}


_SETTINGS: dict[str, Callable[[Namespace], dict[str, Any]]] = {
    "demo": _demo,
    "video": _video,
    "camera": _camera,
}
"""Command -> the parameters that it gives its source."""


def _play(args: Namespace, **settings: Any) -> int:
    _refuse_double_use(args.record, getattr(args, "input", None))
    logging.basicConfig(format="ros-visualise: %(message)s", level=logging.WARNING)
    logging.getLogger("ros_visualise").setLevel(logging.INFO)
    if args.size:
        settings["size"] = args.size
    graph = _graph(args, settings)
    view = open_view(args.view, args.host, args.port)
    try:
        return _run(args, graph, view)
    finally:
        view.close()


def _graph(args: Namespace, settings: dict[str, Any]) -> Graph:
    graph = image_pipeline(args.source, **settings)
    last = "filters"
    for text in args.node:
        path, name, after = parse_node(text)
        added = registry.load(path, name)
        graph = graph.insert(added, after or last)
        last = last if after else added.name
    if args.params:
        try:
            graph = graph.configured(_read_yaml(args.params))
        except ParameterError as error:
            raise UsageError(f"{args.params}: {error}") from None
    for text in args.set:
        key, equals, value = text.partition("=")
        node, dot, param = key.partition(".")
        if not (equals and dot):
            raise UsageError(f"--set {text}: give NODE.PARAM=VALUE")
        graph = graph.configured({node: {param: value}})
    return graph


def _run(args: Namespace, graph: Graph, view: View) -> int:
    playback = Playback(
        rate=1.0 if args.rate is None else args.rate,
        loop=args.loop or (args.command == "demo" and view.stays),
        start_s=args.start or 0.0,
        duration_s=args.duration,
        frames=args.frames,
        hold=view.stays and args.duration is None and args.frames is None,
    )
    runtime = interruptible(lambda: LocalRuntime(graph, playback))
    interrupted = False
    try:
        recordings = _start_recordings(runtime, args.record, args.overwrite)
        runtime.start()
        view.open(runtime)
        while not (runtime.wait(0) or view.closed or any(one.error for one in recordings)):
            view.spin(_SPIN_S)
    except KeyboardInterrupt:
        interrupted = True
    finally:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)
        view.close()
        runtime.stop()
    report = runtime.report()
    _say_summary(report)
    if args.json:
        print(json.dumps(report, default=str))
    return 130 if interrupted else int(runtime.failed)


def _start_recordings(
    runtime: LocalRuntime, targets: list[str], overwrite: bool
) -> list[RecorderThread]:
    """All of them, or none."""
    recordings: list[RecorderThread] = []
    try:
        for target in targets:
            recordings.append(runtime.start_recording(target, overwrite))
    except RosVisualiseError:
        for recording in recordings:
            runtime.stop_recording(recording)
            recording.path.unlink(missing_ok=True)
        raise
    return recordings


def _refuse_double_use(targets: list[str], source: str | None) -> None:
    used = [Path(source)] if source else []
    for target in targets:
        path = parse_target(target)[0]
        if any(_is_same(path, other) for other in used):
            raise UsageError(f"--record {path}: is in use already; choose another name")
        used.append(path)


def _is_same(path: Path, other: Path) -> bool:
    if path.exists() and other.exists():
        return path.samefile(other)  # by whichever of its names
    return path.resolve() == other.resolve()


def _say_summary(report: dict[str, Any]) -> None:
    for name, topic in report["topics"].items():
        rates = f"{topic['hz'] or 0:g} Hz by the stamps, {topic['wall_hz'] or 0:g} per second"
        print(f"{name}: {topic['messages']} messages, {rates}", file=sys.stderr)
    for name, node in report["nodes"].items():
        for reason, count in node["dropped"].items():
            print(f"{name}: {count} of {node['received']} left out by {reason}", file=sys.stderr)
    for name, recording in report["recordings"].items():
        dropped = f", {recording['dropped']} dropped" if recording["dropped"] else ""
        print(f"{name}: {recording['messages']} messages recorded{dropped}", file=sys.stderr)


def _read_yaml(path: Any) -> dict[str, dict[str, Any]]:
    try:
        values = YAML(typ="safe").load(path.read_text())
    except OSError as error:
        raise OpenError(
            f"{path}: {error.strerror}; give a YAML file as NODE: {{PARAM: VALUE}}"
        ) from None
    except (YAMLError, UnicodeDecodeError) as error:
        raise OpenError(f"{path}: not YAML: {' '.join(str(error).split())}") from None
    values = {} if values is None else values
    if not isinstance(values, dict) or not all(isinstance(v, dict) for v in values.values()):
        raise OpenError(f"{path}: must hold NODE: {{PARAM: VALUE}}")
    return values
