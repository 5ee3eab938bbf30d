"""Planning a batch, running its tasks with one progress bar, and writing its tables."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

from tqdm import tqdm

from ros_visualise.batch.apart import Limits, Stopped, TaskFailure
from ros_visualise.batch.cluster import LOCAL, SHARED, run_on_cluster
from ros_visualise.batch.inference import network_servers, run_served
from ros_visualise.batch.inputs import find_inputs
from ros_visualise.batch.local import Outcome, run_here
from ros_visualise.batch.plan import identify, plan, split, task_of
from ros_visualise.batch.results import Planned, Results
from ros_visualise.batch.rows import parse_field
from ros_visualise.batch.tables import connect
from ros_visualise.batch.task import Task, run_task, survey
from ros_visualise.batch.work import Work, absolute
from ros_visualise.commands.batch import BatchOptions
from ros_visualise.core.errors import UsageError
from ros_visualise.core.printing import counted, print_json, print_result, print_status, sized
from ros_visualise.core.signals import STOPPED, StopRequest, noticed
from ros_visualise.graph.presets import check_preset
from ros_visualise.landmarks.networks.session import Provider
from ros_visualise.sinks import kind_of
from ros_visualise.sinks.names import check_targets, parse_target

_SHOWN = 5  # failures that are printed
_HOST = "127.0.0.1"
_SPIN_S = 0.05


def run(options: BatchOptions) -> int:
    """Run a batch, or show or retry one; 1 if a task failed."""
    verbs = {"status": _status, "retry": _retry, "view": _view}
    verb = verbs.get(options.input[0])
    if verb and len(options.input) == 2:
        return verb(Results(Path(options.input[1])), options)
    if options.out is None:
        raise UsageError("batch: give the folder of the results: --out DIR")
    connect().close()
    work = _work(options)
    results = Results(options.out)
    inputs = find_inputs(options.input)
    print_status(f"{counted(len(inputs), 'recording')}, {sized(sum(one.size for one in inputs))}")
    results.create()
    results.clean()
    with noticed() as request:
        planned = plan(inputs, identify(inputs, results, _workers(options)), work)
        if options.segment:
            engine = partial(_map, options, work.device, request)
            planned = split(
                planned,
                work,
                lambda tasks: engine(survey, tasks),
                results,
                options.segment,
                options.overlap,
                print_status,
            )
        kept = {"work": asdict(work), "overlap": options.overlap}
        results.write_plan(kept, planned)
        return _execute(results, planned, work, options, request)


def _work(options: BatchOptions) -> Work:
    """The work, with everything checked that can be without a recording."""
    for text in options.fields:
        parse_field(text)
    _check_names(options)
    if options.preset:
        check_preset(options.preset)
    work = Work(
        pipeline=options.pipeline,
        node=tuple(map(absolute, options.node)),
        set=tuple(map(absolute, options.set)),
        params=os.path.abspath(options.params) if options.params else "",
        preset=options.preset,
        topics=tuple(options.topics),
        image=options.image,
        odom=options.odom,
        fields=tuple(options.fields),
        record=tuple(options.record),
        export=tuple(options.export),
        device=options.device,
        version=version("ros_visualise"),
    )
    work.check()
    return work


def _check_names(options: BatchOptions) -> None:
    """Reject names of files to record that cannot be those of each run."""
    targets = [parse_target(text)[0] for text in options.record]
    for target in targets:
        kind_of(target)
        if str(target) != target.name:
            raise UsageError(
                f"--record {target}: give a name without a folder; each run is recorded to"
                " DIR/files/RECORDING"
            )
    check_targets([*targets, *map(Path, options.export)])


def _workers(options: BatchOptions) -> int:
    return options.workers or len(os.sched_getaffinity(0))


def _map(
    options: BatchOptions,
    device: str,
    request: StopRequest,
    work: Callable[[Task], Any],
    tasks: Iterable[Task],
) -> Iterator[Outcome]:
    limits = Limits(options.timeout, options.max_memory)
    engine = partial(run_on_cluster, options.cluster) if options.cluster else run_here
    is_here = options.cluster in ("", LOCAL)  # tasks elsewhere open their networks themselves
    device = device if is_here else Provider.CPU.value
    with network_servers(device, options.max_memory, print_status) as servers:
        if servers:
            work = partial(run_served, work, servers)
        yield from engine(work, tasks, limits, _workers(options), lambda: request.asked)


def _execute(
    results: Results,
    planned: Sequence[Planned],
    work: Work,
    options: BatchOptions,
    request: StopRequest,
) -> int:
    """Run what is left of a plan, write the tables, and report."""
    began_s = time.monotonic()
    left = _left(results, planned)
    tasks = (task_of(one, work, results, options.overlap) for one in left.values())
    try:
        outcomes = _map(options, work.device, request, run_task, tasks) if left else iter(())
        failed = _run(results, left, outcomes, len({one.key for one in planned}))
    except Stopped:
        print_status("stopped; run the same command again to continue")
        return STOPPED
    results.clean()
    rows = results.compact(planned)
    report = _report(results, planned)
    report |= {"run": len(left), "failed_now": failed, "tables": rows}
    report["wall_s"] = round(time.monotonic() - began_s, 3)
    _print(report, options.json, results)
    return int(bool(report["failures"]))


def _left(results: Results, planned: Iterable[Planned]) -> dict[str, Planned]:
    """Key -> a task that is neither done nor failed."""
    return {
        one.key: one
        for one in planned
        if not results.is_done(one.key) and results.failure(one.key) is None
    }


def _run(
    results: Results, left: Mapping[str, Planned], outcomes: Iterator[Outcome], count: int
) -> int:
    """Run what is left, with a progress bar; the number of failures."""
    failed = 0
    if len(left) < count:
        print_status(f"{count - len(left)} of {counted(count, 'task')} already done")
    tqdm.set_lock(threading.RLock())  # its own is for processes too, and slow to import
    total = sum(one.size for one in left.values())
    elsewhere = set[str]()
    done = count - len(left)
    with tqdm(
        total=total, unit="B", unit_scale=True, disable=None, dynamic_ncols=True, leave=False
    ) as bar:
        for task, outcome in outcomes:
            done += 1
            if isinstance(outcome, TaskFailure):
                failed += 1
                # recordings of one content share their task
                reason = outcome.reason.removeprefix(f"{task.path}: ")
                results.fail(task.key, outcome._replace(reason=reason))
            elif not results.is_done(task.key):
                elsewhere.add(task.key)
            bar.set_postfix_str(f"{done} of {count} tasks, {failed} failed", refresh=False)
            bar.update(left[task.key].size)
    for key in elsewhere.difference(os.listdir(results.tasks)):  # which also looks anew on NFS
        failed += 1
        results.fail(key, TaskFailure("error", f"its results did not arrive; {SHARED}"))
    return failed


def _status(results: Results, options: BatchOptions) -> int:
    _, planned = results.read_plan()
    _print(_report(results, planned), options.json, results)
    return 0


def _view(results: Results, options: BatchOptions) -> int:
    """Show the page of the results until it is stopped."""
    from ros_visualise.batch.page import ResultsPage  # the web server takes a while to import
    from ros_visualise.ui.page.server import url
    from ros_visualise.ui.server.access import access_rules

    rules = access_rules(_HOST)
    with noticed() as request, closing(ResultsPage(results, _HOST, options.port, rules)):
        print_status(f"open {url(_HOST, options.port, rules.token)} (Ctrl-C stops)")
        while not request.asked:
            time.sleep(_SPIN_S)
    return STOPPED


def _retry(results: Results, options: BatchOptions) -> int:
    """Do again what failed, also tasks in which nodes had errors."""
    kept, planned = results.read_plan()
    with_errors = {one["key"] for one in results.failures() if one["kind"] == "node"}
    for one in planned:
        if one.key in with_errors or results.failure(one.key) is not None:
            results.forget(one.key)
    options = replace(options, overlap=kept["overlap"])  # which the keys depend on
    with noticed() as request:
        return _execute(results, planned, Work.restored(kept["work"]), options, request)


def _report(results: Results, planned: Sequence[Planned]) -> dict[str, Any]:
    failures = [
        {"recording": one.recording, "begin_s": one.begin_s, **failure._asdict()}
        for one in planned
        if (failure := results.failure(one.key)) is not None
    ]
    done = sum(results.is_done(one.key) for one in planned)
    return {
        "recordings": len({one.recording for one in planned}),
        "tasks": len(planned),
        "done": done,
        "left": len(planned) - done - len(failures),
        "failures": failures + [one for one in results.failures() if one["kind"] == "node"],
    }


def _print(report: dict[str, Any], as_json: bool, results: Results) -> None:
    if as_json:
        print_json(report)
        return
    with_errors = sum(one["kind"] == "node" for one in report["failures"])
    failed = len(report["failures"]) - with_errors
    lines = [
        f"{counted(report['recordings'], 'recording')}, {counted(report['tasks'], 'task')}:"
        f" {report['done']} done{f' ({with_errors} with errors)' if with_errors else ''},"
        f" {report['left']} left, {failed} failed"
    ]
    for one in report["failures"][:_SHOWN]:
        lines.append(f"  {one['recording']}: {one['kind']}: {one['reason']}")
    if len(report["failures"]) > _SHOWN:
        lines.append(f"  and {len(report['failures']) - _SHOWN} more in {results.folder}")
    lines += [
        f"{name}: {counted(rows, 'row')}" for name, rows in report.get("tables", {}).items() if rows
    ]
    print_result(lines)
