"""Access control of the playground: only the page that it serves may connect."""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from http import HTTPStatus
from ipaddress import ip_address
from typing import Any
from urllib.parse import urlsplit

from websockets.asyncio import server as websockets
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from finger_pin.exceptions import FingerPinError

Handler = Callable[[websockets.ServerConnection, Request], Response | None]


@contextmanager
def own_page_only(host: str) -> Iterator[None]:
    """Make servers that viser starts in this context refuse requests of other pages.

    Viser passes its handler of requests to `websockets` and accepts no custom one: it is wrapped there.

    Args:
        host: Interface on which the page is served.

    Raises:
        FingerPinError: If no handler was wrapped, as viser starts its server in another way.
    """
    serve, wrapped_hosts = websockets.serve, []

    def guarded_serve(*arguments: Any, process_request: Handler, **options: Any) -> Any:
        wrapped_hosts.append(host)
        return serve(*arguments, process_request=partial(_handle, host, process_request), **options)

    websockets.serve = guarded_serve  # type: ignore[assignment,misc]
    try:
        yield
    finally:
        websockets.serve = serve  # type: ignore[misc]
    if not wrapped_hosts:
        raise FingerPinError("this version of viser cannot be kept from other pages: install viser 1.1")


def _handle(host: str, handler: Handler, connection: websockets.ServerConnection, request: Request) -> Response | None:
    reason = refusal(request.headers, host)
    if reason:
        return connection.respond(HTTPStatus.FORBIDDEN, f"{reason}\n")
    return handler(connection, request)


def refusal(headers: Headers, host: str) -> str:
    """Return the reason for refusing a request, or nothing if it comes from the page itself.

    A name that a foreign DNS server points to this machine is refused, addresses are accepted. Browsers send the
    origin of the page that opens a WebSocket, and no page can change it.

    Args:
        headers: Headers of the request.
        host: Interface on which the page is served.
    """
    hosts = headers.get_all("Host")
    name = urlsplit(f"//{hosts[0]}").hostname if len(hosts) == 1 else None
    if name is None or not (_is_address(name) or name in _host_names(host)):
        return f"Host {', '.join(hosts)}: open the page by an address or a name of this machine, such as localhost"
    origins = headers.get_all("Origin")
    if headers.get("Upgrade") is None and not origins:
        return ""
    if [urlsplit(origin).netloc.lower() for origin in origins] != [hosts[0].lower()]:
        return f"Origin {', '.join(origins) or 'missing'}: only the page of {hosts[0]} itself may play"
    return ""


def _host_names(host: str) -> set[str]:
    hostname = socket.gethostname().lower()
    return {"localhost", host.lower(), hostname, f"{hostname}.local", socket.getfqdn().lower()}


def _is_address(name: str) -> bool:
    with suppress(ValueError):
        return bool(ip_address(name))
    return False
