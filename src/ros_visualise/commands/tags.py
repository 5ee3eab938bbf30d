"""``tags``: AprilTag and ArUco tags on pages, for printing."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ros_visualise.commands import Command
from ros_visualise.running.arguments import argument, option, tag_size


@dataclass(frozen=True, kw_only=True)
class TagsOptions:
    """Options of ``tags``."""

    output: Path = argument(
        "the new file: a .pdf with a page for each tag, or an .svg of one tag", metavar="OUT"
    )
    ids: str = option("0", "ids of the tags, such as 7 or 0-3,12 (default: %(default)s)")
    size: float | None = option(
        None,
        "side of the black square in metres, the tag size that detectors need (default: the"
        " largest that fits the page)",
        type=tag_size,
        metavar="M",
    )
    family: str = option(
        "tag36h11", "family of the tags, such as tag25h9 or 5x5_1000 (default: %(default)s)"
    )
    page: str = option(
        "A4", "A4, A3, Letter or WIDTHxHEIGHT in mm (default: %(default)s)", metavar="PAGE"
    )
    overwrite: bool = option(False, "replace an existing file")


def run(options: TagsOptions) -> int:
    """Write the pages."""
    from ros_visualise.core.errors import UsageError
    from ros_visualise.core.printing import counted, print_status
    from ros_visualise.landmarks.calibration.sheet import lay_out_tag, to_pdf, to_svg
    from ros_visualise.landmarks.tags import family
    from ros_visualise.sinks.trajectory import save

    of, suffix = family(options.family), options.output.suffix.lower()
    sheets = [lay_out_tag(of, id, options.page, options.size) for id in _ids(options.ids)]
    if suffix not in (".pdf", ".svg"):
        raise UsageError(f"{options.output}: give a name that ends in .pdf or .svg")
    if suffix == ".svg" and len(sheets) > 1:
        raise UsageError(
            f"{options.output}: an .svg file holds one page; give a single id, or write a .pdf"
        )
    save(
        {options.output: to_pdf(*sheets) if suffix == ".pdf" else to_svg(*sheets)},
        options.overwrite,
    )
    side = f"{sheets[0].side:g} mm"
    print_status(
        f"{options.output}: {counted(len(sheets), 'page')}, {of.name} with a side of {side}; print "
        "at 100% and measure the square"
    )
    return 0


def _ids(text: str) -> list[int]:
    """The ids in a text such as 0-3,12."""
    import re

    from ros_visualise.core.errors import UsageError

    found: list[int] = []
    for part in text.split(","):
        one = re.fullmatch(r"\s*(\d{1,5})(?:-(\d{1,5}))?\s*", part)
        if not one or not (ids := range(int(one[1]), int(one[2] or one[1]) + 1)):
            raise UsageError(f"--ids {text}: give ids such as 7 or 0-3,12")
        found += ids
    if len(found) > _MOST:
        raise UsageError(f"--ids {text}: {len(found)} pages; give at most {_MOST} ids")
    return found


_MOST = 200

COMMAND = Command("print AprilTag or ArUco tags at an exact size", TagsOptions, run)
