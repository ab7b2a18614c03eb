"""Access to the playground: from the page that it serves, and from no other page that the user's browser shows."""

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
    """Let servers that viser starts meanwhile refuse requests of other pages.

    Viser passes its handler of requests to `websockets`, and takes none of the user's: it is wrapped there.

    Args:
        host: Interface on which the page is served.

    Raises:
        FingerPinError: If no handler was wrapped, as viser starts its server in another way.
    """
    serve, wrapped = websockets.serve, []

    def guarded(*arguments: Any, process_request: Handler, **options: Any) -> Any:
        wrapped.append(host)
        return serve(*arguments, process_request=partial(_checked, host, process_request), **options)

    websockets.serve = guarded  # type: ignore[assignment,misc]
    try:
        yield
    finally:
        websockets.serve = serve  # type: ignore[misc]
    if not wrapped:
        raise FingerPinError("this version of viser cannot be kept from other pages: install viser 1.1")


def _checked(host: str, handler: Handler, connection: websockets.ServerConnection, request: Request) -> Response | None:
    trouble = refusal(request.headers, host)
    if trouble:
        return connection.respond(HTTPStatus.FORBIDDEN, f"{trouble}\n")
    return handler(connection, request)


def refusal(headers: Headers, host: str) -> str:
    """Return the reason for refusing a request, or nothing if it comes from the page itself.

    A name that a stranger's DNS points to this machine is no name of it; addresses are what they say. Browsers send the
    origin of the page that opens a WebSocket, and no page can change it.

    Args:
        headers: Of the request.
        host: Interface on which the page is served.
    """
    asked = headers.get_all("Host")
    name = urlsplit(f"//{asked[0]}").hostname if len(asked) == 1 else None
    if name is None or not (_is_address(name) or name in _names(host)):
        return f"Host {', '.join(asked)}: open the page by an address or a name of this machine, such as localhost"
    origins = headers.get_all("Origin")
    if headers.get("Upgrade") is None and not origins:
        return ""
    if [urlsplit(origin).netloc.lower() for origin in origins] != [asked[0].lower()]:
        return f"Origin {', '.join(origins) or 'missing'}: only the page of {asked[0]} itself may play"
    return ""


def _names(host: str) -> set[str]:
    hostname = socket.gethostname().lower()
    return {"localhost", host.lower(), hostname, f"{hostname}.local", socket.getfqdn().lower()}


def _is_address(name: str) -> bool:
    with suppress(ValueError):
        return bool(ip_address(name))
    return False
