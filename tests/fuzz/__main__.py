"""Give damaged input of every kind to the commands: make fuzz ARGS='--seed 7 --count 1000'.

Each mutant of a whole input is shown by info, played and converted. None may crash, hang, print a
traceback, take more than 2 GiB, or lose messages without a word that another reader finds. What
fails is kept, with the line that tries it again.
"""

from __future__ import annotations

import argparse
import json
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from fuzz.worker import keep, work

_BATCH = 200  # mutants for one process, which may leak


def main() -> int:
    """Try mutants; 1 if any failed."""
    args = _parser().parse_args()
    if args.batch:
        work(args)
        return 0
    number, end = args.first, args.first + args.count
    print(f"seed {args.seed}: mutants {number} to {end - 1}", flush=True)
    begun, failures = time.monotonic(), 0
    while number < end and time.monotonic() - begun < args.time:
        tried, failed = _run_batch(args, number, min(end, number + _BATCH))
        number += tried
        failures += failed
    tried_s = time.monotonic() - begun
    print(f"{number - args.first} mutants, {failures} failures, {tried_s:.0f} s")
    return int(failures > 0)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="make fuzz", description=__doc__)
    parser.add_argument("--seed", type=int, default=random.randrange(10**6), help="of the damage")
    parser.add_argument("--first", type=int, default=0, help="number of the first mutant")
    parser.add_argument("--count", type=int, default=1000, help="so many mutants (%(default)s)")
    parser.add_argument(
        "--time", type=float, default=3600, help="begin nothing after these seconds"
    )
    parser.add_argument("--kinds", nargs="+", default=[], help="of these kinds of input alone")
    parser.add_argument("--made", action="store_true", help="of made input alone, not of real")
    kept = Path(tempfile.gettempdir(), "fuzz")
    parser.add_argument("--keep", type=Path, default=kept, help="folder for failures (%(default)s)")
    parser.add_argument("--batch", type=Path, help=argparse.SUPPRESS)
    return parser


def _run_batch(args: argparse.Namespace, first: int, end: int) -> tuple[int, int]:
    """Mutants in a process of their own, for as long as that lives; how many, and failures."""
    options = ["--seed", args.seed, "--first", first, "--count", end - first, "--keep", args.keep]
    options += ["--kinds", *args.kinds] if args.kinds else []
    options += ["--made"] if args.made else []
    tried = failures = 0
    with tempfile.TemporaryDirectory(prefix="fuzz_") as folder:
        command = [sys.executable, "-m", "fuzz", *options, "--batch", folder]
        errors = Path(folder, "errors")
        with errors.open("w") as file, _start(command, file) as process:
            for line in process.stdout:
                said = json.loads(line)
                if "faults" in said:
                    failures += 1
                    _report(args, said)
                else:
                    tried += 1
        if process.returncode:
            why = f"the process ended with {process.returncode}: {errors.read_text()[-3000:]}"
            if not tried:
                raise SystemExit(f"nothing could be tried: {why}")
            keep(args, said, Path(folder, "mutant"))
            failures += 1
            _report(args, {**said, "faults": [why]})
    return tried, failures


def _start(command: list[Any], errors: Any) -> Any:
    line = [str(part) for part in command]
    return subprocess.Popen(line, stdout=subprocess.PIPE, stderr=errors, text=True)


def _report(args: argparse.Namespace, said: dict[str, Any]) -> None:
    again = f"--seed {args.seed} --first {said['number']} --count 1"
    again += f" --kinds {' '.join(args.kinds)}" if args.kinds else ""
    again += " --made" if args.made else ""
    print(f"\n{said['kind']}, made of {said['whole']}; kept in {args.keep}/{said['name']}")
    print(f"again: make fuzz ARGS='{again}'")
    for fault in said["faults"]:
        print("  " + fault.replace("\n", "\n    "), flush=True)


if __name__ == "__main__":
    sys.exit(main())
