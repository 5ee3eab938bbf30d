"""``compare``: the results of two batches against each other."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ros_visualise.commands import Command
from ros_visualise.running.arguments import argument, not_negative, option


@dataclass(frozen=True, kw_only=True)
class CompareOptions:
    """Options of ``compare``."""

    before: Path = argument("folder of a batch's results", metavar="BEFORE")
    after: Path = argument("folder of another batch's results", metavar="AFTER")
    limits: Path | None = option(
        None,
        "YAML file with the largest allowed changes (default: no changes, except in times)",
        metavar="FILE.yaml",
    )
    junit: Path | None = option(None, "write the changes as JUnit XML", metavar="FILE.xml")
    html: Path | None = option(
        None,
        "write an HTML page that shows the moments that changed most, side by side",
        metavar="FILE.html",
    )
    truth: str = option(
        "/ground_truth/odom", "topic with the true poses (default: %(default)s)", metavar="TOPIC"
    )
    slop: float = option(
        0.02,
        "largest time difference between messages that are compared, seconds (default: 0.02)",
        type=not_negative,
        metavar="S",
    )
    json: bool = option(False, "print all changes as one JSON object")
    overwrite: bool = option(False, "replace existing files")


def run(options: CompareOptions) -> int:
    """Compare; 1 if a change is beyond its limit."""
    from contextlib import closing

    from ros_visualise.batch.comparison import ResultComparison
    from ros_visualise.batch.comparison_report import (
        ChangeLimits,
        read_limits,
        summary,
        to_html,
        to_junit,
        to_text,
    )
    from ros_visualise.core.printing import counted, print_json, print_result
    from ros_visualise.sinks.files import write_file

    limits = read_limits(options.limits) if options.limits else ChangeLimits({})
    opened = ResultComparison(options.before, options.after, options.truth, options.slop)
    with closing(opened) as comparison:
        changes = comparison.changes()
        beyond = [one for one in changes if not limits.allow(one)]
        if options.junit:
            xml = to_junit(changes, limits, comparison.recordings())
            write_file(options.junit, xml, options.overwrite)
        if options.html:
            page = to_html(comparison, changes, limits, f"{options.before} and {options.after}")
            write_file(options.html, page, options.overwrite)
        rows = summary(changes, limits)
        if options.json:
            all_changes = [{**one._asdict(), "limit": limits.find(one)} for one in changes]
            print_json({"beyond": len(beyond), "summary": rows, "changes": all_changes})
        else:
            total = f"{counted(len(beyond), 'change')} beyond the limits"
            print_result([*(to_text(rows) if rows else []), total])
    return int(bool(beyond))


COMMAND = Command("compare the results of two batches", CompareOptions, run)
