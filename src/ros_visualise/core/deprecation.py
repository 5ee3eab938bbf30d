"""Former names, which are still taken for one release."""

from __future__ import annotations

import warnings


def deprecated(old: str, new: str) -> None:
    """Warn the caller of our caller that a name goes with the next minor version.

    It is a FutureWarning, which Python shows everywhere; a DeprecationWarning of a node in a file
    would stay unseen.
    """
    warnings.warn(f"{old} is deprecated; use {new}", FutureWarning, stacklevel=3)
