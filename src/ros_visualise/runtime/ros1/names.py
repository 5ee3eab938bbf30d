"""Names of topics, as our nodes give them."""

from __future__ import annotations


def global_name(topic: str) -> str:
    """``/tf`` for ``tf``: whatever their namespace, all robots have one tree of frames."""
    return f"/{topic}" if topic in ("tf", "tf_static") else topic
