"""How Cyclone DDS sends large messages, where nobody has configured it.

By itself it cuts them into pieces of 1344 bytes, and asks for one that was lost after a tenth of a
second. An image of 25 MB is 18 000 of those, of which a few are lost whenever the subscriber does
not read for a moment: at 30 of them each second most never come to be whole.

Source: the guide to the options of Cyclone DDS 0.10, ``General`` and ``Internal``.
"""

from __future__ import annotations

import os

_VARIABLE = "CYCLONEDDS_URI"

_SETTINGS = """<CycloneDDS><Domain>
<General><MaxMessageSize>65500B</MaxMessageSize><FragmentSize>63000B</FragmentSize></General>
<Internal>
<NackDelay>1ms</NackDelay>
<SocketReceiveBufferSize max="16MB"/>
</Internal>
</Domain></CycloneDDS>"""
"""The largest pieces that UDP takes, and as much room for them as the system gives a socket."""


def configure() -> None:
    """Set what is best for images; what a person has set stays as it is."""
    os.environ.setdefault(_VARIABLE, "".join(_SETTINGS.splitlines()))
