"""Private parameters of executables, beside those of their nodes; read once."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from ros_visualise.core.errors import UsageError
from ros_visualise.core.limits import DEFAULT_MEMORY, parse_memory, set_max_memory
from ros_visualise.core.paths import set_folder
from ros_visualise.runtime.middleware import Host
from ros_visualise.runtime.saving import load
from ros_visualise.ui import ViewOptions
from ros_visualise.vision.compression import JPEG_QUALITY

OPTIONS = (
    *("view", "host", "port", "token", "allow_origin", "window", "record_dir", "overwrite"),
    *("image_transport", "jpeg_quality", "start", "duration", "stay"),
    *("clock", "max_memory", "params"),
)
"""Parameters that every executable reads."""


def choose_memory(host: Host) -> None:
    """Set the limit that ``~max_memory`` gives.

    Raises:
        UsageError: not an amount of memory.
    """
    set_max_memory(parse_memory(str(host.option("max_memory", DEFAULT_MEMORY))))


def choose_view(host: Host, default: str) -> tuple[str, ViewOptions]:
    """The name and the options of the view in ``~view``; sets the folder of files.

    Raises:
        UsageError: an option is of the wrong type.
    """
    name = str(host.option("view", default))
    folder = Path(host.find_file(str(host.option("record_dir", "."))))
    options = ViewOptions(record_dir=folder, flag=host.flag)
    if name == "web":
        address, port = str(host.option("host", "127.0.0.1")), _number(host, "port", 8080)
        origins = named_in(host, "allow_origin", "none")
        token = switch(host, "token", True)
        options = replace(options, host=address, port=int(port), origins=origins, token=token)
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
    quality = _number(host, "jpeg_quality", JPEG_QUALITY)
    if quality not in range(1, 101):
        raise UsageError(f"jpeg_quality={quality:g}: must be a whole number from 1 to 100")
    return int(quality)


def choose_params(host: Host) -> dict[str, Any]:
    """The contents of the file ``~params``; see `ros_visualise.runtime.saving.of_node`.

    Raises:
        OpenError: it cannot be read, or holds something else.
    """
    path = host.option("params", "none")
    return {} if path == "none" else load(Path(host.find_file(str(path))))


def seconds(host: Host, option: str) -> float:
    """An option in seconds; 0 by default.

    Raises:
        UsageError: not a number.
    """
    return _number(host, option, 0.0)


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


def _number(host: Host, option: str, default: float) -> float:
    given = host.option(option, default)
    try:
        return float(given)
    except (TypeError, ValueError):
        raise UsageError(f"{option}={given}: must be a number") from None
