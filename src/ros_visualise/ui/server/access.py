"""Access to the page: every request is checked here.

Any web site that a person visits can send requests to programs on their machine. With each request,
browsers send the server's name (``Host``) and the requesting site (``Origin``), and no site can
forge these. A site whose name suddenly points to this machine (DNS rebinding) shows in both. Other
accounts on this machine reach its servers too, so the page's address holds a token.
"""

from __future__ import annotations

import hmac
import os
import re
import secrets
import socket
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from ipaddress import ip_address
from typing import NamedTuple
from urllib.parse import SplitResult, urlsplit

from ros_visualise.core.errors import UsageError

LOOPBACK_NAMES = frozenset({"127.0.0.1", "localhost", "::1"})
_DESKTOP = "file://"  # the origin of Electron's apps
_PORTS = {"http": 80, "https": 443}
_SITE = re.compile(r"https?://([a-z0-9.-]+|\[[0-9a-f:.]+\])(:\d{1,5})?")
_OWN_SITES = ("none", "same-origin")  # "none": typed, or a bookmark
_SHOWN = 100  # characters of what a stranger sent
_TOKEN_VARIABLE, _VIEW_TOKEN_VARIABLE = "ROS_VISUALISE_TOKEN", "ROS_VISUALISE_VIEW_TOKEN"
_TOKEN = re.compile(r"[A-Za-z0-9_-]{16,200}")


class Fetch(NamedTuple):
    """A browser's reason for a request (``Sec-Fetch-Site``, ``-Mode``, ``-Dest``).

    Browsers send it to this machine and over https; otherwise it is empty.
    """

    site: str = ""
    mode: str = ""
    dest: str = ""


_UNSAID = Fetch()


@dataclass(frozen=True)
class AccessRules:
    """Decides which requests are answered.

    Attributes:
        names: the names of this server in its own pages' addresses.
        proxies: other names that ``Host`` may have: those of the sites in ``origins``.
        addresses: whether ``Host`` may be any address, as for a server on all interfaces.
        origins: other web sites that may use the page, as ``https://example.org``; ``file://``
            stands for apps on a desktop.
        token: the first part of each request's path; empty: none.
        view_token: its alternative for read-only requests.
    """

    names: frozenset[str]
    proxies: frozenset[str] = frozenset()
    addresses: bool = False
    origins: frozenset[str] = frozenset()
    token: str = ""
    view_token: str = ""

    def refusal(self, path: str, host: str, origin: str | None, fetch: Fetch = _UNSAID) -> str:
        """The reason why a request is rejected; empty if it is allowed.

        Args:
            host: its ``Host``: the name or address, and the port, of this server.
            origin: its ``Origin``: the requesting site, if it comes from a page.
        """
        called = _split(f"//{host}").hostname
        if called not in self.proxies and not self._is_called(called):
            name = repr(host[:_SHOWN])
            return f"unknown host name {name}; --allow-origin http://NAME allows it"
        if origin is not None and origin not in self.origins and not self._is_own(origin, host):
            return f"request from the web site {origin[:_SHOWN]!r}; --allow-origin SITE allows it"
        if origin not in self.origins and not self._may_lead_here(fetch):
            return "request from another web site; other sites may only link to this page"
        if self.token and not (_begins(path, self.token) or self.is_viewer(path)):
            return "token missing; open the whole address that was printed at the start"
        return ""

    def is_viewer(self, path: str) -> bool:
        """True if an allowed request is read-only."""
        return bool(self.view_token) and _begins(path, self.view_token)

    def is_foreign(self, fetch: Fetch) -> bool:
        """True if a link on another web site may have led here; none knows the token."""
        return not self.token and fetch.site not in _OWN_SITES

    def inside(self, path: str) -> str:
        """The path of an allowed request, without the token."""
        token = self.view_token if self.is_viewer(path) else self.token
        return path.removeprefix(f"/{token}") if token else path

    def _may_lead_here(self, fetch: Fetch) -> bool:
        """True unless another site sent the request; following a link there is allowed."""
        framed = {"iframe", "frame"} if self.origins else set()
        is_link = fetch.mode == "navigate" and fetch.dest in {"document"} | framed
        return is_link or not fetch.site or fetch.site in _OWN_SITES

    def _is_own(self, origin: str, host: str) -> bool:
        """True if a page came from this server."""
        site = _split(origin)
        called = _split(f"//{host}", site.scheme)
        is_page = site.scheme in _PORTS  # and no browser's extension
        return is_page and self._is_called(site.hostname) and _port(site) == _port(called)

    def _is_called(self, name: str | None) -> bool:
        return name is not None and (name in self.names or (self.addresses and _is_address(name)))


def access_rules(host: str, origins: Collection[str] = (), token: bool = True) -> AccessRules:
    """The rules for a server that listens at an address.

    Unless ``token`` is False, every request needs one: a new one for each run, or that in the
    environment variable ``ROS_VISUALISE_TOKEN``; that in ``ROS_VISUALISE_VIEW_TOKEN`` is read-only.

    Raises:
        UsageError: an origin is not a site, or a token is too short or has other characters.
    """
    allowed = frozenset(map(_origin, origins))
    proxies = frozenset(name for origin in allowed if (name := _split(origin).hostname))
    names, addresses = LOOPBACK_NAMES | {host.lower()}, not is_loopback(host)
    if addresses:
        own = socket.gethostname().lower()  # and no longer name: that is looked up on the network
        names |= {own, f"{own}.local"}
    tokens = _choose_tokens(os.environ) if token else ("", "")
    return AccessRules(names, proxies, addresses, allowed, *tokens)


def is_loopback(host: str) -> bool:
    """True if only this machine can reach an address or a name."""
    try:
        found = socket.getaddrinfo(host or "0.0.0.0", None)
    except (OSError, UnicodeError):  # of a name that cannot be one
        return False
    return all(ip_address(str(address[0]).partition("%")[0]).is_loopback for *_, address in found)


def _choose_tokens(environment: Mapping[str, str]) -> tuple[str, str]:
    """The token, and the read-only one."""
    token = _choose_token(environment, _TOKEN_VARIABLE)
    view_token = _choose_token(environment, _VIEW_TOKEN_VARIABLE)
    if token == view_token:
        raise UsageError(f"{_TOKEN_VARIABLE}, {_VIEW_TOKEN_VARIABLE}: give two different tokens")
    return token, view_token


def _choose_token(environment: Mapping[str, str], variable: str) -> str:
    token = environment.get(variable) or secrets.token_urlsafe(16)
    if not _TOKEN.fullmatch(token):
        raise UsageError(f"{variable}: give 16 to 200 letters, digits, - or _")
    return token


def _begins(path: str, token: str) -> bool:
    """True if a token is the first part of a path; takes the same time for any other."""
    first = re.split("[/?]", path.removeprefix("/"), maxsplit=1)[0]
    return hmac.compare_digest(first.encode(), token.encode())


def _origin(text: str) -> str:
    if text == _DESKTOP:
        return text
    site = text.lower().rstrip("/")
    if not _SITE.fullmatch(site) or not _split(site).hostname:
        raise UsageError(f"--allow-origin {text}: give a site such as https://robot.example.org")
    return site


def _split(url: str, scheme: str = "") -> SplitResult:
    """The parts of a URL; all empty for a malformed one."""
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
