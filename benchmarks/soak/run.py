"""Run the program for hours, and see whether anything of it grows.

    python benchmarks/soak/run.py [--hours 2] [--scenarios demo bag camera ros1] [--out FOLDER]

All scenarios run at the same time, each with a page and a client that looks. Every half minute the
memory, open files and threads of their processes are noted, and how late the page is. In the end
there is a table with slopes, and the exit status is 1 if a process ended or grows; what was noted
stays in the folder for `report.py`.
"""

import argparse
import shutil
import signal
import tempfile
import time
from pathlib import Path

from report import growing, picture, table
from samples import Log, Sample, read, take
from scenarios import SCENARIOS, Scenario

_CONNECTED_S = 120.0
"""A client that looks has to be connected by then."""


class Soak:
    """Scenarios that run side by side, and what is noted of them."""

    def __init__(self, folder: Path, names: list[str]) -> None:
        self._folder = folder
        self._logs = {name: Log(folder / f"{name}.csv") for name in names}
        self._scenarios: dict[str, Scenario] = {}
        self._started_s: dict[str, float] = {}
        self.ended: list[str] = []

    def start(self) -> None:
        """Start all of them, one after the other."""
        for name in self._logs:
            self._scenarios[name] = scenario = SCENARIOS[name](self._folder / name)
            scenario.start()
            self._started_s[name] = time.monotonic()
            print(f"{name} runs", flush=True)

    def note(self) -> None:
        """Measure every process, and tend every scenario."""
        for name, scenario in list(self._scenarios.items()):
            elapsed_s = time.monotonic() - self._started_s[name]
            for process_name, process in scenario.watched.items():
                if process.has_ended:
                    self._give_up(name, f"{process.log} ended with {process.bury()}")
                    break
                sample = take(name, process_name, process, scenario.looker, elapsed_s)
                self._logs[name].add(sample)
                if why := _blind(scenario, sample):
                    self._give_up(name, why)
                    break
            else:
                scenario.tend(elapsed_s)

    def end(self) -> None:
        """End all that was started."""
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # it is ending
        for scenario in self._scenarios.values():
            scenario.end()
        for log in self._logs.values():
            log.close()

    def _give_up(self, name: str, why: str) -> None:
        print(f"{name}: {why}", flush=True)
        self.ended.append(name)
        self._scenarios.pop(name).end()


def main() -> int:
    args = _arguments()
    folder = args.out or Path(tempfile.mkdtemp(prefix="ros_visualise_soak_"))
    folder.mkdir(parents=True, exist_ok=True)
    print(f"what is noted goes to {folder}", flush=True)
    soak, status = Soak(folder, args.scenarios), 0
    for ending in (signal.SIGINT, signal.SIGTERM):  # the first is ignored in a shell's background
        signal.signal(ending, signal.default_int_handler)
    try:
        soak.start()
        end_s = time.monotonic() + args.hours * 3600
        while time.monotonic() < end_s:
            soak.note()
            time.sleep(args.every)
    except KeyboardInterrupt:
        status = 130
    finally:
        soak.end()
    found = tell(folder, args.scenarios)
    return status or int(bool(found or soak.ended))


def _blind(scenario: Scenario, sample: Sample) -> str:
    """Why nobody looks at a page that is to be looked at; empty where somebody does."""
    if scenario.looker is None:
        return ""
    if scenario.looker.has_ended:
        return f"{scenario.looker.log} ended with {scenario.looker.bury()}"
    is_late = sample.time_s > _CONNECTED_S and not sample.connected
    return f"{scenario.looker.log} has not connected in {_CONNECTED_S:.0f} s" if is_late else ""


def tell(folder: Path, names: list[str]) -> list[str]:
    """Print the table, draw the picture, and say what grows."""
    series = {key: one for name in names for key, one in read(folder / f"{name}.csv").items()}
    if not series:
        return []
    print(table(series))
    (folder / "soak.svg").write_bytes(picture(series).svg())
    found = growing(series)
    for what in found:
        print(what)
    return found


def _arguments() -> argparse.Namespace:
    there = [name for name in SCENARIOS if name != "ros1" or shutil.which("roscore")]
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--hours", type=float, default=2.0)
    parser.add_argument("--scenarios", nargs="+", choices=SCENARIOS, default=there)
    parser.add_argument("--every", type=float, default=30.0, help="seconds between two samples")
    parser.add_argument("--out", type=Path, help="folder for logs, samples and recordings")
    return parser.parse_args()


if __name__ == "__main__":
    raise SystemExit(main())
