"""What is measured of a process, and the file that it is kept in."""

import csv
import json
from collections import defaultdict
from dataclasses import asdict, dataclass, fields
from pathlib import Path

from processes import Process


@dataclass(frozen=True)
class Sample:
    """A process at a time; latencies are those of the page that somebody looks at, in ms."""

    scenario: str
    process: str
    time_s: float
    rss_mb: float
    fds: int
    threads: int
    answer_ms: float | None
    latency_ms: float | None
    sent_mb: float | None
    connected: int | None


def take(
    scenario: str, name: str, process: Process, looker: Process | None, time_s: float
) -> Sample:
    """Measure a process, and read what who looks says last."""
    there = Path(f"/proc/{process.pid}")
    status = dict(line.split(":", 1) for line in (there / "status").read_text().splitlines())
    try:
        told = json.loads(looker.last_line()) if looker else {}
    except ValueError:
        told = {}
    sent = told.get("bytes")
    return Sample(
        scenario,
        name,
        round(time_s, 1),
        int(status["VmRSS"].split()[0]) * 1024 / 1e6,
        len(list((there / "fd").iterdir())),
        int(status["Threads"]),
        told.get("answer_ms"),
        told.get("latency_ms"),
        None if sent is None else sent / 1e6,
        told.get("connected"),
    )


class Log:
    """A CSV file that grows by a line with each sample."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("x", newline="")
        self._writer = csv.DictWriter(self._file, [one.name for one in fields(Sample)])
        self._writer.writeheader()

    def add(self, sample: Sample) -> None:
        """Write a sample, at once."""
        self._writer.writerow(asdict(sample))
        self._file.flush()

    def close(self) -> None:
        """Nothing more is written."""
        self._file.close()


def read(path: Path) -> dict[tuple[str, str], list[Sample]]:
    """The samples of each process, by scenario and name."""
    found: dict[tuple[str, str], list[Sample]] = defaultdict(list)
    with path.open(newline="") as file:
        for row in csv.DictReader(file):
            sample = Sample(
                row["scenario"],
                row["process"],
                float(row["time_s"]),
                float(row["rss_mb"]),
                int(row["fds"]),
                int(row["threads"]),
                *(float(row[name]) if row[name] else None for name in _TOLD),
            )
            found[sample.scenario, sample.process].append(sample)
    return found


_TOLD = ("answer_ms", "latency_ms", "sent_mb", "connected")
