"""What was probably meant by a name that there is not."""

from __future__ import annotations

from collections.abc import Iterable


def near(name: str, there: Iterable[str], listed: bool = True) -> str:
    """``; did you mean filters?`` if a known name is close or begins so, else a list of all.

    Args:
        name: what was given.
        there: what could have been; case does not matter.
        listed: whether to tell all of them where none is close.
    """
    from difflib import get_close_matches  # not at each --help

    known = list(there)
    folded = {one.casefold(): one for one in reversed(known)}
    given = name.casefold()
    begun = [one for one in folded if given and one.startswith(given)]
    found = get_close_matches(given, folded, n=1) or begun
    if found:
        return f"; did you mean {folded[found[0]]}?"
    if not listed:
        return ""
    return f"; choose from {', '.join(known)}" if known else "; there is none"
