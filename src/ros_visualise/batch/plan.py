"""The plan of a batch: a task for each recording or part of one, and the keys of these."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

from ros_visualise.batch.apart import TaskFailure
from ros_visualise.batch.inputs import FoundInput, content_of, signature_of
from ros_visualise.batch.results import Planned, Results
from ros_visualise.batch.task import About, Task
from ros_visualise.batch.work import Work
from ros_visualise.core.regular_files import read_file

_CACHE = "contents.json"
_LEAST_PART = 0.1  # of the length of the others: a shorter rest belongs to the last part
_NS = 1e-9

Survey = Callable[[Iterable[Task]], Iterator[tuple[Task, About | TaskFailure]]]


def identify(inputs: Sequence[FoundInput], results: Results, workers: int) -> list[str]:
    """The content of each recording; empty for one that cannot be read.

    Digests are kept, and made again when a file has another size or time.
    """
    cache: dict[str, list[str]] = {}
    with suppress(OSError, ValueError):
        cache = json.loads(read_file(results.folder / _CACHE))

    def identified(one: FoundInput) -> list[str]:
        try:
            signature = signature_of(one.path)
            known = cache.get(one.path, ["", ""])
            return known if known[0] == signature else [signature, content_of(one.path)]
        except OSError:
            return ["", ""]

    with ThreadPoolExecutor(workers) as pool:
        found = list(pool.map(identified, inputs))
    new = {one.path: both for one, both in zip(inputs, found, strict=True)}
    if new != cache:
        results.write(_CACHE, json.dumps(new))
    return [content for _, content in found]


def plan(inputs: Sequence[FoundInput], contents: Sequence[str], work: Work) -> list[Planned]:
    """A task for each recording."""
    digest = work.digest()
    return [
        Planned(_key(content or one.path, digest), one.name, one.path, one.size, content)
        for one, content in zip(inputs, contents, strict=True)
    ]


def split(
    planned: Sequence[Planned],
    work: Work,
    survey: Survey,
    results: Results,
    segment_s: float,
    overlap_s: float,
    say: Callable[[str], None],
) -> list[Planned]:
    """The plan with recordings that are longer than a segment split into parts."""
    tasks = {one.key: task_of(one, work, results) for one in planned}
    abouts = {task.key: about for task, about in survey(tasks.values())}
    digest = work.digest()
    found = []
    for one in planned:
        about = abouts[one.key]
        if isinstance(about, TaskFailure):
            if not results.is_done(one.key):
                results.fail(one.key, about)
            found.append(one)
            continue
        length_s = (about.end_ns - about.start_ns) * _NS
        count = max(1, int(length_s / segment_s + 1 - _LEAST_PART))
        if count > 1 and about.unsplittable:
            needs = f"the whole recording is needed by {', '.join(about.unsplittable)}"
            say(f"{one.recording}: not split, because {needs}")
            count = 1
        ends = [segment_s * number for number in range(1, count)]
        parts = list(zip([0.0, *ends], [*ends, length_s + segment_s], strict=True))
        found += [one] if count == 1 else [_part(one, *part, digest, overlap_s) for part in parts]
    return found


def task_of(one: Planned, work: Work, results: Results, warm_up_s: float = 0.0) -> Task:
    """The task of a plan's line."""
    folder = os.path.abspath(results.tasks)
    return Task(one.key, one.path, work, folder, one.begin_s, one.until_s, warm_up_s)


def _part(one: Planned, begin_s: float, until_s: float, digest: str, overlap_s: float) -> Planned:
    key = _key(one.content or one.path, digest, begin_s, until_s, overlap_s)
    return one._replace(key=key, begin_s=begin_s, until_s=until_s)


def _key(*parts: object) -> str:
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:32]
