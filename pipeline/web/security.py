"""Access control: token, hosts, origins, the session's cookie and key, and response headers.

Other users of this machine can connect to any port of it. The token, which only the user who
started the server sees, is exchanged for the cookie by a page without data (ENTRY); it stands in
the fragment of that page's address, which no browser sends.

A page of another site can make a browser send requests here. It cannot forge the Host or Origin
header, read the key in our pages, add our header without a preflight (which is never granted), or
have the browser send a SameSite=Strict cookie. All are required, so that the failure of one
protection is not enough. A name that resolves to 127.0.0.1 (DNS rebinding) is stopped by the Host
header.
"""

from __future__ import annotations

import hmac
import ipaddress
import secrets
import socket
from collections.abc import Mapping
from dataclasses import field

from ..errors import WheelplaneError
from ..system import frozen

KEY_HEADER = "X-Wheelplane-Key"
SAFE_METHODS = ("GET", "HEAD")
ENTRY, SESSION = "/enter", "/api/session"
OPEN_PATHS = ("/", ENTRY, SESSION, "/viewer.js")  # without data of the user, and /static/
LOCAL_NAMES = frozenset({"localhost", "127.0.0.1", "[::1]"})

_ONLY_OURS = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "connect-src 'self'; font-src 'self'; frame-src 'self'; form-action 'self'; base-uri 'none'; "
    "frame-ancestors 'none'"
)
# A report contains its script and style, and loads nothing; sandboxed, it has an opaque origin.
_REPORT = (
    "sandbox allow-scripts allow-modals; default-src 'none'; script-src 'unsafe-inline'; "
    "style-src 'unsafe-inline'; img-src data: blob:; font-src data:; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'self'"
)
_ALWAYS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()",
}


class RefusedError(WheelplaneError):
    """Refused request; code: HTTP status."""

    def __init__(self, code: int, text: str) -> None:
        super().__init__(text)
        self.code = code


@frozen
class Guard:
    """Requirements on requests.

    port: None for a Unix socket, to which any port may be forwarded. names: hosts by which this
    server may be addressed. addresses: any numeric address may be a host, for a server open to the
    network. token: admits a browser.
    """

    port: int | None
    names: frozenset[str] = LOCAL_NAMES
    addresses: bool = False
    token: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    session: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    key: str = field(default_factory=lambda: secrets.token_urlsafe(32))

    @property
    def cookie(self) -> str:
        """Name of the session's cookie, with the port: all ports of a host share cookies."""
        return f"wheelplane-{self.port or 'socket'}"

    def check(self, method: str, path: str, headers: Mapping[str, str], cookie: str) -> None:
        """Raise RefusedError unless the request comes from our own page."""
        self._check_host(headers.get("Host", ""))
        is_safe = method in SAFE_METHODS
        if not (is_safe and path == ENTRY):  # a file of the user's, or a link, may lead there
            self._check_origin(headers)
        if path not in OPEN_PATHS and not path.startswith("/static/") and not self.knows(cookie):
            raise RefusedError(403, "no session with this server: open the printed address again")
        if not is_safe and path != SESSION and not same(headers.get(KEY_HEADER, ""), self.key):
            raise RefusedError(403, "the request lacks this page's key: reload the page")

    def knows(self, cookie: str) -> bool:
        """Return whether the cookie is that of a browser that has shown the token."""
        return same(cookie, self.session)

    def exchange(self, token: str) -> str:
        """Return the session's cookie for the token. Raises RefusedError for any other."""
        if not same(token, self.token):
            raise RefusedError(403, "this is not the token of the server: open the printed address")
        return self.session

    def _check_host(self, host: str) -> None:
        name, _, port = host.rpartition(":")
        if host.endswith("]") or ":" not in host:
            name, port = host, "80"
        if port != str(self.port or port) or not (
            name.lower() in self.names or (self.addresses and _is_address(name))
        ):
            raise RefusedError(
                421, f"the host {host[:80]!r} is not this server: use the printed address"
            )

    def _check_origin(self, headers: Mapping[str, str]) -> None:
        origin, host = headers.get("Origin"), headers.get("Host", "")
        if origin is not None and origin.lower() != f"http://{host.lower()}":
            raise RefusedError(403, f"the request comes from another site ({origin[:80]!r})")
        if headers.get("Sec-Fetch-Site", "none") not in ("same-origin", "none"):
            raise RefusedError(403, "the request comes from another site")


def guard_for(host: str, port: int | None) -> Guard:
    """Create the guard of a server bound to `host`."""
    names = LOCAL_NAMES | {in_address(host).lower()}
    if is_loopback(host):
        return Guard(port, names)
    own = socket.gethostname().lower()
    names |= {own, f"{own.partition('.')[0]}.local"}
    return Guard(port, names, addresses=True)


def in_address(host: str) -> str:
    """Return the host as written in a URL: IPv6 addresses in brackets."""
    return f"[{host}]" if ":" in host else host


def is_loopback(host: str) -> bool:
    """Return whether only this machine can reach a server bound to `host`."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def response_headers(*, report: bool = False, api: bool = False) -> dict[str, str]:
    """Return the security headers of a response."""
    policy = {"Content-Security-Policy": _REPORT if report else _ONLY_OURS}
    return _ALWAYS | policy | ({"Cache-Control": "no-store"} if api or report else {})


def same(given: str, expected: str) -> bool:
    """Compare two secrets in constant time."""
    return hmac.compare_digest(given.encode(errors="replace"), expected.encode())


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name.strip("[]"))
    except ValueError:
        return False
    return True
