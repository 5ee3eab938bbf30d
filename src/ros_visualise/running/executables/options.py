"""Private parameters of executables, beside those of their nodes; read once."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ros_visualise.core.errors import UsageError
from ros_visualise.core.paths import set_folder
from ros_visualise.links.commands import permit
from ros_visualise.runtime.middleware import Host
from ros_visualise.ui import ViewOptions
from ros_visualise.vision.compression import JPEG_QUALITY

OPTIONS = (
    *(
        "view",
        "host",
        "port",
        "token",
        "allow_origin",
        "allow_control",
        "window",
        "record_dir",
        "overwrite",
    ),
    *("image_transport", "jpeg_quality", "start", "duration", "stay"),
    *("clock", "max_memory", "params"),
)
"""Parameters that every executable reads."""


def choose_view(host: Host, default: str) -> tuple[str, ViewOptions]:
    """The name and the options of the view in ``~view``; sets the folder of files, and if vehicles
    may be commanded.

    Raises:
        UsageError: an option is of the wrong type.
    """
    name = str(host.option("view", default))
    control = switch(host, "allow_control", False)
    permit(control)
    folder = Path(host.find_file(str(host.option("record_dir", "."))))
    options = ViewOptions(record_dir=folder, flag=host.flag)
    if name == "web":
        address, port = str(host.option("host", "127.0.0.1")), number(host, "port", 8080)
        origins = named_in(host, "allow_origin", "none")
        token = switch(host, "token", True)
        options = replace(options, host=address, port=int(port), origins=origins, token=token)
        options = replace(options, control=control)
    elif name == "windows":
        options = replace(options, place=str(host.option("window", "")))
    set_folder(options.record_dir, bool(host.option("overwrite", False)))
    return name, options


def choose_image_transport(host: Host) -> bool:
    """True if images come compressed.

    Raises:
        UsageError: unknown ``~image_transport``.
    """
    transport = host.option("image_transport", "raw")
    if transport not in ("raw", "compressed"):
        raise UsageError(f'invalid image_transport "{transport}"; use raw or compressed')
    return bool(transport == "compressed")


def choose_jpeg_quality(host: Host) -> int:
    """The quality of the JPEGs that are published, in percent.

    Raises:
        UsageError: ``~jpeg_quality`` is not from 1 to 100.
    """
    quality = number(host, "jpeg_quality", JPEG_QUALITY)
    if quality not in range(1, 101):
        raise UsageError(f"jpeg_quality={quality:g}: must be a whole number from 1 to 100")
    return int(quality)


def switch(host: Host, option: str, default: bool) -> bool:
    """An option that is true or false.

    Raises:
        UsageError: neither.
    """
    given = host.option(option, default)
    if not isinstance(given, bool):
        raise UsageError(f"{option}={given}: give true or false")
    return given


def named_in(host: Host, option: str, default: str) -> list[str]:
    """The names in an option, separated by spaces; none by default."""
    named = str(host.option(option, default))
    return [] if named == default else named.split()


def number(host: Host, option: str, default: float = 0.0) -> float:
    """An option that is a number.

    Raises:
        UsageError: not a number.
    """
    given = host.option(option, default)
    try:
        return float(given)
    except (TypeError, ValueError):
        raise UsageError(f"{option}={given}: must be a number") from None
