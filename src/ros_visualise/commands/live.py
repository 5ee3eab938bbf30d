"""``live``: the topics of a server on the network."""

from __future__ import annotations

from dataclasses import dataclass

from ros_visualise.commands import Command
from ros_visualise.core.errors import UsageError
from ros_visualise.running.arguments import argument
from ros_visualise.running.options import TopicOptions


@dataclass(frozen=True, kw_only=True)
class LiveOptions(TopicOptions):
    """Options of ``live``."""

    input: str = argument(
        "address of a Foxglove WebSocket server or of rosbridge", metavar="ws://HOST:PORT"
    )


def run(options: LiveOptions) -> int:
    """Show the topics until stopped."""
    from ros_visualise.running.graphs import server
    from ros_visualise.running.play import play
    from ros_visualise.sources.servers import is_server

    if options.rate is not None or options.loop or options.start is not None:
        raise UsageError("--rate, --loop and --start do not apply to live topics; omit them")
    if not is_server(options.input):
        raise UsageError(f"{options.input}: give an address such as ws://192.168.1.10:8765")
    return play(server(options.input, options.topics, options.image, options.odom), options)


COMMAND = Command("show live topics of a Foxglove server or rosbridge", LiveOptions, run)
