"""The process that tries a batch of mutants, and says of each what it is before it does."""

from __future__ import annotations

import argparse
import faulthandler
import json
import random
import resource
import shutil
from pathlib import Path
from typing import Any

from fuzz.mutants import mutate

_LIMIT_S = 60  # for one mutant, which needs a tenth of a second
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
        mutate(whole, mutant / whole.name, rng)
        said = {"number": number, "kind": kind, "whole": whole.name}
        said["name"] = f"{args.seed}-{number}-{kind}"
        print(json.dumps(said), flush=True)
        faulthandler.dump_traceback_later(_LIMIT_S, exit=True)
        faults = examine(mutant / whole.name, kind, args.batch)
        faulthandler.cancel_dump_traceback_later()
        if faults:
            keep(args, said, mutant)
            print(json.dumps({**said, "faults": faults}), flush=True)
        if peak_mib() > MOST_MIB:
            return


def keep(args: argparse.Namespace, said: dict[str, Any], mutant: Path) -> None:
    """A copy of a mutant that outlives the process."""
    kept = args.keep / said["name"]
    shutil.rmtree(kept, ignore_errors=True)
    args.keep.mkdir(parents=True, exist_ok=True)
    shutil.copytree(mutant, kept)
