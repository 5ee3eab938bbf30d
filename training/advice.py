"""One line instead of a traceback where a script of this folder lacks a package.

A script imports this module before all others.
"""

from __future__ import annotations

import sys
from pathlib import Path
from types import TracebackType

_EXTRA = "pip install '.[headless,sim,train]'"
_HOW = {
    "cv2": _EXTRA,
    "mujoco": _EXTRA,
    "onnx": _EXTRA,
    "onnxruntime": _EXTRA,
    "ros_visualise": _EXTRA,
    "skimage": _EXTRA,
    "torch": "pip install torch, or as training/README.md says",
}


def explain(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """Report an exception that nothing caught; a missing package in one line, with status 2."""
    package = (getattr(error, "name", None) or "").partition(".")[0]
    if not (isinstance(error, ModuleNotFoundError) and package in _HOW):
        return sys.__excepthook__(kind, error, trace)
    print(f"{Path(sys.argv[0]).name} needs {package}: {_HOW[package]}", file=sys.stderr)
    sys.exit(2)


if Path(sys.argv[0]).resolve().parent == Path(__file__).resolve().parent:  # not in a test
    sys.excepthook = explain
