"""Access to the page: every request is checked here.

A web site that somebody visits can send requests to programs on their machine. With each request,
browsers say the server's name (``Host``) and the site that asks (``Origin``), and no site can forge
these. A site whose name suddenly points to this machine (DNS rebinding) shows in both.
"""

from __future__ import annotations

import hmac
import os
import re
import secrets
import socket
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from ipaddress import ip_address
from urllib.parse import SplitResult, urlsplit

from ros_visualise.errors import UsageError

LOOPBACK_NAMES = frozenset({"127.0.0.1", "localhost", "::1"})
_PORTS = {"http": 80, "https": 443}
_SITE = re.compile(r"https?://([a-z0-9.-]+|\[[0-9a-f:.]+\])(:\d{1,5})?")
_SHOWN = 100  # characters of what a stranger sent
_TOKEN_VARIABLE = "ROS_VISUALISE_TOKEN"
_TOKEN = re.compile(r"[A-Za-z0-9_-]{16,200}")


@dataclass(frozen=True)
class Door:
    """Decides which requests are answered.

    Attributes:
        names: the names of this server in its own pages' addresses.
        proxies: other names that ``Host`` may have: those of the sites in ``origins``.
        addresses: whether ``Host`` may be any address, as for a server on all interfaces.
        origins: other web sites that may use the page, as ``https://example.org``.
        token: what the path of a request has to begin with; empty: nothing.
    """

    names: frozenset[str]
    proxies: frozenset[str] = frozenset()
    addresses: bool = False
    origins: frozenset[str] = frozenset()
    token: str = ""

    def refusal(self, path: str, host: str, origin: str | None) -> str:
        """Why a request is refused, in words; empty if it is allowed.

        Args:
            path: the path that is asked for.
            host: its ``Host``: the name or address, and the port, of this server.
            origin: its ``Origin``: the site that asks, if a page does.
        """
        called = _split(f"//{host}").hostname
        if called not in self.proxies and not self._is_called(called):
            name = repr(host[:_SHOWN])
            return f"this server is not called {name}; --allow-origin http://NAME allows a name"
        if origin is not None and origin not in self.origins and not self._is_own(origin, host):
            return f"a page of {origin[:_SHOWN]!r} asked for access; --allow-origin SITE allows it"
        if self.token and not hmac.compare_digest(_first_part(path).encode(), self.token.encode()):
            return "open the whole address, with its token, that was printed at the start"
        return ""

    def is_foreign(self, sites: Sequence[str]) -> bool:
        """Whether another web site may have led a browser here.

        Args:
            sites: each ``Sec-Fetch-Site`` of an allowed request. Browsers send it to this machine
                and over https. Where they do not, the token tells that nobody else made the link.
        """
        return list(sites) not in (["none"], ["same-origin"]) and not (self.token and not sites)

    def inside(self, path: str) -> str:
        """The path of an allowed request, without the token."""
        return path.removeprefix(f"/{self.token}") if self.token else path

    def _is_own(self, origin: str, host: str) -> bool:
        """Whether a page came from this server."""
        site = _split(origin)
        called = _split(f"//{host}", site.scheme)
        is_page = site.scheme in _PORTS  # and no browser's extension
        return is_page and self._is_called(site.hostname) and _port(site) == _port(called)

    def _is_called(self, name: str | None) -> bool:
        return name is not None and (name in self.names or (self.addresses and _is_address(name)))


def open_door(host: str, origins: Collection[str] = ()) -> Door:
    """The checks for a server that listens at an address.

    If other machines can reach it, every request needs a token: a new one for each run, or that in
    the environment variable ``ROS_VISUALISE_TOKEN``.

    Raises:
        UsageError: an origin is not a site, or the token is too short or has other characters.
    """
    allowed = frozenset(map(_origin, origins))
    proxies = frozenset(_split(origin).hostname or "" for origin in allowed)
    if is_loopback(host):
        return Door(LOOPBACK_NAMES | {host.lower()}, proxies, origins=allowed)
    own = socket.gethostname().lower()
    names = LOOPBACK_NAMES | {host.lower(), own, f"{own}.local", socket.getfqdn().lower()}
    return Door(names, proxies, addresses=True, origins=allowed, token=_choose_token(os.environ))


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach an address or a name."""
    try:
        found = socket.getaddrinfo(host or "0.0.0.0", None)
    except (OSError, UnicodeError):  # of a name that cannot be one
        return False
    return all(ip_address(str(address[0]).partition("%")[0]).is_loopback for *_, address in found)


def _choose_token(environment: Mapping[str, str]) -> str:
    token = environment.get(_TOKEN_VARIABLE) or secrets.token_urlsafe(16)
    if not _TOKEN.fullmatch(token):
        raise UsageError(f"{_TOKEN_VARIABLE}: give 16 to 200 letters, digits, - or _")
    return token


def _origin(text: str) -> str:
    site = text.lower().rstrip("/")
    if not _SITE.fullmatch(site) or not _split(site).hostname:
        raise UsageError(f"--allow-origin {text}: give a site as https://robot.example.org")
    return site


def _split(url: str, scheme: str = "") -> SplitResult:
    """The parts of a URL; None of a malformed one."""
    try:
        parts = urlsplit(url, scheme)
        _ = parts.port
        return parts
    except ValueError:
        return urlsplit("")


def _port(url: SplitResult) -> int | None:
    return url.port or _PORTS.get(url.scheme)


def _is_address(name: str) -> bool:
    try:
        ip_address(name)
    except ValueError:
        return False
    return True


def _first_part(path: str) -> str:
    return re.split("[/?]", path.removeprefix("/"), maxsplit=1)[0]
