"""Views of a result in a browser on this machine: a page, served on the loopback address only."""

from __future__ import annotations

import html
import sys
import threading
import webbrowser
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Self

import xarray as xr
from numpy.typing import ArrayLike

from finger_pin.analysis import ForcePolytope
from finger_pin.mechanism.coerce import FingerLike
from finger_pin.mechanism.finger import Finger
from finger_pin.progress import in_notebook
from finger_pin.threads import wait_for
from finger_pin.views.viewer.animation import animation_page, posture_page

#: Height of the page in a notebook, pixels.
_PAGE_HEIGHT = 620


class PageHandle:
    """A page that is being served; a context manager that ends it.

    Attributes:
        url: Its address, on the loopback interface.
    """

    def __init__(self, page: str) -> None:
        """Serve a page, HTML text, from a thread."""
        self._page = page
        self._server = ThreadingHTTPServer(("127.0.0.1", 0), self._handler())
        self._hosts = {f"{host}:{self._server.server_port}" for host in ("127.0.0.1", "localhost")}
        self.url = f"http://127.0.0.1:{self._server.server_port}/"
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.05,), daemon=True)
        self._thread.start()

    def wait(self) -> None:
        """Serve until the user interrupts (Ctrl-C), or the page is closed from elsewhere."""
        wait_for(self._thread, self.close)

    def close(self) -> None:
        """Stop serving; open pages keep their frames. Closing twice is allowed."""
        if self._thread.is_alive():
            self._server.shutdown()
            self._thread.join()
            self._server.server_close()

    def _handler(self) -> type[BaseHTTPRequestHandler]:
        server, content = self, self._page.encode()

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                # A foreign host name that resolves to the loopback address is refused.
                if self.headers.get("Host") not in server._hosts:
                    self.send_error(403)
                elif self.path != "/":
                    self.send_error(404)
                else:
                    self.send_response(200)
                    self.send_header("Content-Type", "text/html; charset=utf-8")
                    self.send_header("Cache-Control", "no-store")
                    self.send_header("Content-Length", str(len(content)))
                    self.end_headers()
                    self.wfile.write(content)

            def log_message(self, format: str, *args: object) -> None:
                pass

        return Handler

    def __repr__(self) -> str:
        """Return the address."""
        return f"<{type(self).__name__} at {self.url}>"

    def _repr_html_(self) -> str:
        # Notebooks embed the page: the address is useless where they run on another machine.
        page = html.escape(self._page)
        return f'<iframe srcdoc="{page}" width="100%" height="{_PAGE_HEIGHT}" style="border: none"></iframe>'

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, *error: object) -> None:
        """Stop serving."""
        self.close()


def view(
    result: xr.Dataset,
    *,
    forces: ForcePolytope | None = None,
    ghost: xr.Dataset | None = None,
    finger: Finger | None = None,
    open_browser: bool | None = None,
    block: bool | None = None,
) -> PageHandle:
    """Show a result in meshcat: the finger moves, its tendons run along their paths in the colour of their tension.

    Args:
        result: Dataset that `simulate` returned or saved.
        forces: Polytope of `force_polytope`, drawn translucent at the fingertip of its posture.
        ghost: Another result, whose finger moves faintly beside this one at the same times.
        finger: The finger that moved, if it stands on a model of the user's own (`Finger.from_model`).
        open_browser: Whether to open the page in the user's browser; by default unless a notebook shows it.
        block: Whether to serve until Ctrl-C; by default where Python is not interactive and a browser opens.

    Returns:
        The page in service, with its address; already closed if the call has blocked.
    """
    return _serve(animation_page(result, forces, ghost, finger), open_browser, block)


def view_forces(
    finger: FingerLike,
    forces: ForcePolytope,
    *,
    tension: ArrayLike | None = None,
    open_browser: bool | None = None,
    block: bool | None = None,
) -> PageHandle:
    """Show the forces that a fingertip can exert: a translucent body at the tip of the finger at rest.

    Args:
        finger: The finger, its description, its name, or the path of its file.
        forces: Polytope of `force_polytope`.
        tension: Of every strand, shape (s,), N, such as `RequiredTension.strands`; slack by default.
        open_browser: Whether to open the page in the user's browser; by default unless a notebook shows it.
        block: Whether to serve until Ctrl-C; by default where Python is not interactive and a browser opens.

    Returns:
        The page in service, with its address; already closed if the call has blocked.
    """
    return _serve(posture_page(finger, forces, tension), open_browser, block)


def open_page(url: str, open_browser: bool | None, block: bool | None) -> bool:
    """Open a page in the user's browser, and return whether to serve it until Ctrl-C.

    Where no browser can be opened the page is served until Ctrl-C only with ``block``.

    Args:
        url: Address of the page.
        open_browser: Whether to open it; by default unless a notebook shows it.
        block: Whether to serve until Ctrl-C; by default where Python is not interactive.
    """
    use_browser = not in_notebook() if open_browser is None else open_browser
    failed = use_browser and not webbrowser.open(url, new=2)
    if block is not None:
        return block
    if sys.flags.interactive or "ps1" in vars(sys) or in_notebook():
        return False
    if failed:
        print(f"No browser opens here. With block=True {url} is served until Ctrl-C", file=sys.stderr, flush=True)
    return not failed


def _serve(page: str, open_browser: bool | None, block: bool | None) -> PageHandle:
    handle = PageHandle(page)
    if open_page(handle.url, open_browser, block):
        print(f"The finger moves at {handle.url} (Ctrl-C ends this)", flush=True)
        handle.wait()
    return handle
