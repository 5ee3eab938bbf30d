"""``info``: what a file holds."""

from __future__ import annotations

import json
from argparse import Namespace

from ros_visualise import sources
from ros_visualise.commands.interruptible import interruptible


def run(args: Namespace) -> int:
    """Print what a file holds."""
    found = interruptible(lambda: sources.info(args.input))
    if args.json:
        print(json.dumps(found))
        return 0
    topics = found.pop("topics")
    for key, value in found.items():
        print(f"{key + ':':<12}{value}")
    for name, topic in topics.items():
        print(f"{name}  {topic['type']}  {topic['messages']} messages  {topic['hz']} Hz")
    return 0
