"""Errors that people meet: each message is one line that says what to do next.

- RosVisualiseError            the work failed or lost something            (exit status 1)
  - RecordingError             a recording could not be written to its end
  - DamagedMessage             a message cannot be read, or cannot be written
  - UnsupportedImage           a node cannot process images of this encoding
  - UncalibratedCamera         a camera's calibration is missing
  - NoTransform                the transform between two frames is unknown
  - TooLarge                   a part of an input would take more memory than it may
  - Unreachable                a remote node does not answer at the moment
  - UsageError                 wrong usage                                  (exit status 2)
    - ParameterError           no such parameter, or a value out of its range
    - OpenError                an input or a target that cannot be opened

Anything else that is raised is a bug and prints its traceback.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path


class RosVisualiseError(Exception):
    """Base of all errors that this package raises on purpose."""

    exit_status = 1


class RecordingError(RosVisualiseError):
    """A recording could not be written to its end; what was written stays readable."""


class DamagedMessage(RosVisualiseError):
    """A message contradicts itself or its type, or its type is unknown.

    It can be neither read, nor recorded or published.
    """


class UnsupportedImage(RosVisualiseError):
    """A node cannot process images of this encoding."""


class UncalibratedCamera(RosVisualiseError):
    """A camera's calibration is needed, and missing."""


class NoTransform(RosVisualiseError):
    """A frame is unknown, or its transform to another frame at some time is."""


class TooLarge(RosVisualiseError, ValueError):
    """Part of an input would exceed the memory limit."""


class Unreachable(RosVisualiseError, ConnectionError):
    """A remote node does not answer at the moment; asking again may help."""


class UsageError(RosVisualiseError):
    """The call is wrong: the message says what would be right."""

    exit_status = 2


class ParameterError(UsageError):
    """An unknown parameter, or a value of the wrong type, out of its range, or refused."""


class OpenError(UsageError):
    """An input or a recording target that cannot be opened."""

    @classmethod
    def missing(cls, path: str | Path, advice: str = "check the path") -> OpenError:
        """An error for a missing file; suggests a similar name or names the folder."""
        folder = "" if os.path.isabs(path) else f" in {os.getcwd()}"
        meant = _near_file(Path(path))
        return cls(f"{path}: no such file{folder}{meant or f'; {advice}'}")

    @classmethod
    def unreadable(cls, path: str | Path, error: OSError) -> OpenError:
        """A file or folder that the system does not let us read."""
        if isinstance(error, PermissionError):
            return cls(f"{path}: permission denied; try chmod u+rX")
        return cls(f"{path}: {error.strerror or error}; check the path")


def _near_file(path: Path) -> str:
    try:
        there = sorted(os.listdir(path.parent))
    except (OSError, ValueError):
        return ""
    if path.name in there:  # a folder, say
        return ""
    return did_you_mean(path.name, there, listed=False)


def did_you_mean(name: str, known: Iterable[str], listed: bool = True) -> str:
    """Hint for an unknown name: ``; did you mean filters?``, or a list of the known ones.

    Args:
        name: given name; its case does not matter.
        known: names that could have been meant.
        listed: list all of them if none is close.
    """
    from difflib import get_close_matches  # slow to import

    names = list(known)
    folded = {one.casefold(): one for one in reversed(names)}
    given = name.casefold()
    begun = [one for one in folded if given and one.startswith(given)]
    found = get_close_matches(given, folded, n=1) or begun
    if found:
        return f"; did you mean {folded[found[0]]}?"
    if not listed:
        return ""
    return f"; choose from {', '.join(names)}" if names else "; none are available"
