"""The process that tries a batch of mutants, and says of each what it is before it does."""

from __future__ import annotations

import argparse
import faulthandler
import json
import random
import resource
import shutil
import signal
from pathlib import Path
from typing import Any

from fuzz.mutants import mutate

_LIMIT_S = 60  # of the processor for one mutant, which needs a tenth of that
_WAIT_S = 900  # for one that does nothing, or for a machine with much else to do
_LIMIT_BYTES = 8 << 30  # of addresses, so that a bomb does not take the machine with it


def work(args: argparse.Namespace) -> None:
    """Try mutants; where one took too much memory, end, as others could not be told from it."""
    from fuzz.trial import MOST_MIB, examine, peak_mib  # not in the parent: they take a second
    from fuzz.wholes import make

    resource.setrlimit(resource.RLIMIT_AS, (_LIMIT_BYTES, _LIMIT_BYTES))
    wholes = make(args.batch, real=not args.made)
    shutil.copy(wholes["video"][0], args.batch / "video.mkv")
    kinds = args.kinds or list(wholes)
    mutant = args.batch / "mutant"
    for number in range(args.first, args.first + args.count):
        rng = random.Random(f"{args.seed} {number}")
        kind = rng.choice(kinds)
        whole = rng.choice(wholes[kind])
        shutil.rmtree(mutant, ignore_errors=True)
        mutant.mkdir()
        lacks = mutate(whole, mutant / whole.name, rng)
        said = {"number": number, "kind": kind, "whole": whole.name}
        said["name"] = f"{args.seed}-{number}-{kind}"
        print(json.dumps(said), flush=True)
        faulthandler.dump_traceback_later(_WAIT_S, exit=True)
        _limit_processor()
        faults = examine(mutant / whole.name, kind, args.batch, whole if lacks else None)
        faulthandler.cancel_dump_traceback_later()
        if faults:
            keep(args, said, mutant)
            print(json.dumps({**said, "faults": faults}), flush=True)
        if peak_mib() > MOST_MIB:
            return


def _limit_processor() -> None:
    """End this process when it has taken so much more of the processor, and say where it was."""
    faulthandler.register(signal.SIGXCPU, all_threads=True, chain=True)
    used = resource.getrusage(resource.RUSAGE_SELF)
    limit = int(used.ru_utime + used.ru_stime) + _LIMIT_S
    resource.setrlimit(resource.RLIMIT_CPU, (limit, resource.getrlimit(resource.RLIMIT_CPU)[1]))


def keep(args: argparse.Namespace, said: dict[str, Any], mutant: Path) -> None:
    """A copy of a mutant that outlives the process."""
    kept = args.keep / said["name"]
    shutil.rmtree(kept, ignore_errors=True)
    args.keep.mkdir(parents=True, exist_ok=True)
    shutil.copytree(mutant, kept)
