"""Make the shipped network from the one before it: one command, with a manifest of what went in.

    python training/recipe.py OUT --start BEFORE.onnx --nothing FOLDER FILM.mp4

Renders worlds, cuts pictures without landmarks, trains the refinement head on both, and writes
``OUT/shipped.onnx``, its mean with the one before, and ``OUT/manifest.json``. The same again gives
the same file, bit for bit, with the same versions on the same kind of processor.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import torch
from average import average
from negatives import files_in, write_worlds
from running import run

SEED, WORLDS = 7300, 22
NOTHING_SEED, NOTHING_WORLDS = 7200, 12
STEPS = 1000
"""Of the refinement head."""
SHARE = 0.7
"""Of the trained weights in the mean: validation chose it."""
_HERE = Path(__file__).parent


def digest(path: Path) -> str:
    """SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def make(out: Path, start: Path, sources: Sequence[Path]) -> None:
    """Make ``OUT/shipped.onnx`` and its manifest."""
    files = files_in(sources)
    write_worlds(out / "pictures", files, NOTHING_WORLDS, NOTHING_SEED, start)
    words = [str(_HERE / "train.py"), str(out), "--start", str(start), "--minutes", "0"]
    words += ["--seed", str(SEED), "--worlds", str(WORLDS), "--second-steps", str(STEPS)]
    subprocess.run([sys.executable, *words], check=True)
    result = out / "shipped.onnx"
    about = {"seed": str(SEED), "second_steps": str(STEPS), "share": str(SHARE)}
    average(start, out / "aerial.onnx", result, SHARE, about)
    manifest = {
        "result": digest(result),
        "start": digest(start),
        "seed": SEED,
        "worlds": WORLDS,
        "nothing_seed": NOTHING_SEED,
        "nothing_worlds": NOTHING_WORLDS,
        "second_steps": STEPS,
        "share": SHARE,
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
