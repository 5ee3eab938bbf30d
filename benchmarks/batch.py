"""Cost of `ros-visualise batch`: `python benchmarks/batch.py FILM`, such as vtest.avi."""

from __future__ import annotations

import argparse
import ctypes
import os
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import av

from ros_visualise.batch.inputs import find_inputs
from ros_visualise.batch.plan import identify, plan
from ros_visualise.batch.results import Results
from ros_visualise.batch.work import Work

ALONE = """
import sys
from pathlib import Path
from ros_visualise.batch.task import Task, run_task
from ros_visualise.batch.work import Work
work = Work(pipeline="landmarks")
for number, path in enumerate(sorted(Path(sys.argv[1]).iterdir())):
    run_task(Task(str(number), str(path), work, sys.argv[2]))
"""
QUERIES = {
    "count by class": "SELECT label, count(*) FROM detections GROUP BY label",
    "where and when a tag was seen": "SELECT recording, min(t_ns), max(t_ns) FROM detections"
    " WHERE id = '7' GROUP BY recording",
    "worst scores": "SELECT recording, t_ns, score FROM detections ORDER BY score LIMIT 20",
    "detections per recording and class": "SELECT recording, label, count(*), avg(score)"
    " FROM detections GROUP BY ALL",
}


class Cost(NamedTuple):
    """Seconds of a command and all that it starts, and the most memory of its own process."""

    wall_s: float
    cpu_s: float
    driver_mb: float


def cost(*command: object) -> Cost:
    """Run a command; orphans of it are waited for, too."""
    before, start = used_s(), time.monotonic()
    process = subprocess.Popen([*map(str, command)], stdout=subprocess.DEVNULL)
    peak = 0.0
    while process.poll() is None:
        with suppress(OSError):
            status = Path(f"/proc/{process.pid}/status").read_text()
            lines = status.splitlines()
            peak = next((int(one.split()[1]) / 1024 for one in lines if "VmHWM" in one), peak)
        time.sleep(0.02)
    wall_s = time.monotonic() - start
    assert process.returncode == 0
    with suppress(ChildProcessError):
        while True:
            os.wait()
    return Cost(wall_s, used_s() - before, peak)


def used_s() -> float:
    """Processor time of all ended children."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def cut(film: Path, folder: Path, count: int, images: int) -> None:
    """Clips of a film, each of another part of it."""
    folder.mkdir()
    with av.open(str(film)) as opened:
        frames = [one.to_ndarray(format="yuv420p") for one in opened.decode(video=0)]
    for number in range(count):
        first = number % (len(frames) - images)
        shown = frames[first : first + images + number // (len(frames) - images)]
        with av.open(str(folder / f"{number:05d}.mp4"), "w") as made:
            stream = made.add_stream("libx264", rate=10, options={"preset": "ultrafast"})
            stream.height, stream.width = frames[0].shape[0] * 2 // 3, frames[0].shape[1]
            for pixels in shown:
                made.mux(stream.encode(av.VideoFrame.from_ndarray(pixels, format="yuv420p")))
            made.mux(stream.encode())


def batch(folder: Path, out: Path, *options: object) -> Cost:
    """A batch of a folder from the beginning."""
    shutil.rmtree(out, ignore_errors=True)
    command = (sys.executable, "-m", "ros_visualise", "batch", folder, "--out", out)
    return cost(*command, "--pipeline", "landmarks", "--json", *options)


def overhead(film: Path, folder: Path, count: int, images: int, rounds: int) -> None:
    """Batches of short recordings beside one process that does the same."""
    cut(film, folder / "short", count, images)
    found: dict[str, list[Cost]] = {"one process": [], "1 worker": [], "2 workers": []}
    for _ in range(rounds):
        shutil.rmtree(folder / "alone", ignore_errors=True)
        alone = cost(sys.executable, "-c", ALONE, folder / "short", folder / "alone")
        found["one process"].append(alone)
        for workers in (1, 2):
            done = batch(folder / "short", folder / "out", "--workers", workers)
            found[f"{workers} worker{'s' * (workers > 1)}"].append(done)
    print(f"\n{count} recordings of {images} images, {rounds} rounds\n")
    print("| | wall s | CPU s | CPU ratio | overhead of a task, CPU ms | driver MB |")
    print("|---|---|---|---|---|---|")
    for name, costs in found.items():
        pairs = list(zip(costs, found["one process"], strict=True))
        ratio = statistics.median(one.cpu_s / other.cpu_s for one, other in pairs)
        more = statistics.median(one.cpu_s - other.cpu_s for one, other in pairs)
        wall_s, cpu_s, driver_mb = map(statistics.median, zip(*costs, strict=True))
        print(
            f"| {name} | {wall_s:.1f} | {cpu_s:.1f} | {ratio:.2f} | {more / count * 1000:.0f}"
            f" | {driver_mb:.0f} |"
        )


def cluster(film: Path, folder: Path, count: int, images: int, rounds: int) -> None:
    """Tasks of some seconds on two workers, and on a Dask cluster with two workers."""
    cut(film, folder / "long", count, images)
    address = "tcp://127.0.0.1:18786"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    dask = [sys.executable, "-m"]
    scheduler = [*dask, "distributed.cli.dask_scheduler", "--port", "18786", "--no-dashboard"]
    worker = [*dask, "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-dashboard"]
    ratios = []
    with tempfile.TemporaryDirectory() as space:
        started = [
            subprocess.Popen([*scheduler, "--host", "127.0.0.1"], **quiet),
            *(subprocess.Popen([*worker, "--local-directory", space], **quiet) for _ in range(2)),
        ]
        try:
            for _ in range(rounds):
                here = timed_batch(folder, "--workers", "2")
                there = timed_batch(folder, "--cluster", address)
                ratios.append((here, there, there / here))
        finally:
            for process in started:
                process.terminate()
                process.wait()
    here_s, there_s, ratio = map(statistics.median, zip(*ratios, strict=True))
    print(f"\n{count} tasks of {2 * here_s / count:.1f} s on 2 workers, {rounds} rounds\n")
    print("| | wall s | ratio |\n|---|---|---|")
    print(f"| processes | {here_s:.1f} | 1 |\n| Dask | {there_s:.1f} | {ratio:.2f} |")


def timed_batch(folder: Path, *options: str) -> float:
    """Seconds of a batch, while others may run beside it."""
    shutil.rmtree(folder / "out", ignore_errors=True)
    command = [sys.executable, "-m", "ros_visualise", "batch", str(folder / "long")]
    command += ["--out", str(folder / "out"), "--pipeline", "landmarks", *options]
    start = time.monotonic()
    subprocess.run(command, check=True, capture_output=True)
    return time.monotonic() - start


def planning(folder: Path, count: int) -> None:
    """Finding, identifying and planning many recordings; once more with the digests known."""
    (folder / "many").mkdir()
    for number in range(count):
        (folder / "many" / f"{number:05d}.mcap").write_bytes(
            b"\x89MCAP0\r\n" + number.to_bytes(8, "big") * 500
        )
    results = Results(folder / "planned")
    results.create()
    print(f"\n{count} recordings planned\n\n| | s |\n|---|---|")
    for name in ("the first time", "again"):
        start = time.monotonic()
        inputs = find_inputs([str(folder / "many")])
        planned = plan(inputs, identify(inputs, results, 2), Work())
        results.write_plan({}, planned)
        left = sum(not results.is_done(one.key) for one in planned)
        assert left == count
        print(f"| {name} | {time.monotonic() - start:.1f} |")


def querying(folder: Path, rows: int) -> None:
    """Questions about many rows of detections."""
    folder = folder / "asked"
    folder.mkdir()
    import duckdb

    duckdb.execute(
        f"COPY (SELECT 'flight_' || (n // 2000) AS recording, 'k' AS key, n * 33000000 AS t_ns,"
        " 'tag_detector' AS node, '/detections' AS topic, 'camera' AS frame,"
        " 'tag36h11_' || (n % 40) AS label, (n % 40)::VARCHAR AS id, random() AS score,"
        " random() * 640 AS left_px, random() * 480 AS top_px, 40.0 + random() AS width_px,"
        " 40.0 + random() AS height_px, random() AS x, random() AS y, random() AS z"
        f" FROM range({rows}) t(n)) TO '{folder}/detections.parquet'"
        " (FORMAT parquet, COMPRESSION zstd)"
    )
    print(f"\n{rows} rows, {(folder / 'detections.parquet').stat().st_size / 1e6:.0f} MB\n")
    print("| question | s | by the command, s |\n|---|---|---|")
    for name, query in QUERIES.items():
        times: tuple[list[float], list[float]] = ([], [])
        for _ in range(5):
            with Results(folder).open_tables() as sql:
                start = time.monotonic()
                sql.execute(query).fetchall()
                times[0].append(time.monotonic() - start)
            command = (sys.executable, "-m", "ros_visualise", "query", folder, query)
            times[1].append(cost(*command).wall_s)
        print(f"| {name} | {statistics.median(times[0]):.3f} | {statistics.median(times[1]):.2f} |")


def main() -> None:
    """Run all parts, or those named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("film", type=Path)
    parser.add_argument(
        "--parts", nargs="+", default=["planning", "querying", "overhead", "cluster"]
    )
    parser.add_argument("--count", type=int, default=1000, help="short recordings")
    parser.add_argument("--images", type=int, default=25, help="of a short recording")
    parser.add_argument("--tasks", type=int, default=4, help="long recordings of the cluster")
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    ctypes.CDLL(None).prctl(36, 1)  # orphans of a batch become children of this process
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ[name] = "1"
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        if "planning" in options.parts:
            planning(folder, 10_000)
        if "querying" in options.parts:
            querying(folder, 2_000_000)
        if "overhead" in options.parts:
            overhead(options.film, folder, options.count, options.images, options.rounds)
        if "cluster" in options.parts:
            cluster(options.film, folder, options.tasks, options.images * 12, options.rounds)


if __name__ == "__main__":
    main()
