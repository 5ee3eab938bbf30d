"""Make the shipped network from the one before it: one command, with a manifest of what went in.

    python training/recipe.py OUT --start BEFORE.onnx --nothing FOLDER FILM.mp4

Cuts parts of pictures without landmarks, renders worlds, trains both networks on both, and writes
``OUT/shipped.onnx``, their mean with those before, and ``OUT/manifest.json``. All random numbers
have seeds; a graphics card, which adds in any order, repeats the figures but not each bit.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import advice  # noqa: F401
import torch
from average import average
from negatives import files_in, write_worlds
from running import run

SEED, WORLDS = 7700, 296
NOTHING_SEED, NOTHING_WORLDS = 7600, 18
STEPS, SECOND_STEPS = 2600, 3200
BATCH, SECOND_BATCH = 256, 1024
SHARES = 0.8, 0.9
"""Of the trained weights in the means: validation chose them."""
_HERE = Path(__file__).parent


def digest(path: Path) -> str:
    """SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def make(out: Path, start: Path, sources: Sequence[Path]) -> None:
    """Make ``OUT/shipped.onnx`` and its manifest."""
    files = files_in(sources)
    write_worlds(out / "pictures", files, NOTHING_WORLDS, NOTHING_SEED, start)
    words = [str(_HERE / "train.py"), str(out), "--start", str(start)]
    words += ["--minutes", "0", "--second-minutes", "0"]
    numbers = {"seed": SEED, "worlds": WORLDS, "steps": STEPS, "second-steps": SECOND_STEPS}
    numbers |= {"batch": BATCH, "second-batch": SECOND_BATCH}
    words += [word for name, one in numbers.items() for word in (f"--{name}", str(one))]
    subprocess.run([sys.executable, *words], check=True)
    result = out / "shipped.onnx"
    average(start, out / "aerial.onnx", out / "pictures", result, SHARES, SEED)
    manifest = {
        "result": digest(result),
        "start": digest(start),
        **numbers,
        "nothing_seed": NOTHING_SEED,
        "nothing_worlds": NOTHING_WORLDS,
        "shares": SHARES,
        "torch": torch.__version__,
        "code": {path.name: digest(path)[:16] for path in sorted(_HERE.glob("*.py"))},
        "nothing": {path.name: digest(path)[:16] for path in files},
    }
    (out / "manifest.json").write_text(json.dumps(manifest, indent=1) + "\n")


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("out", type=Path, help="folder for pictures and results")
    parser.add_argument("--start", type=Path, required=True, help="ONNX file to go on from")
    nothing = "pictures, films and folders that show no pads and no tags"
    parser.add_argument("--nothing", type=Path, nargs="+", required=True, help=nothing)
    asked = parser.parse_args()
    make(asked.out, asked.start, asked.nothing)
    return 0


if __name__ == "__main__":
    run(main)
