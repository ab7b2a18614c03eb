"""Playground: the loop that steps a scenario in real time, and the page that shows it, which alone may connect."""

from __future__ import annotations

import queue
import socket
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from http import HTTPStatus
from ipaddress import ip_address
from pathlib import Path
from typing import Any, Self
from urllib.parse import urlsplit

import viser
from websockets.asyncio import server as websockets
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from finger_pin.exceptions import FingerPinError
from finger_pin.playground.panel import PAUSE, PLAY, RESET, STEP, Panel
from finger_pin.playground.session import Pacer, Session, save_pieces
from finger_pin.playground.stage import Stage
from finger_pin.simulation.simulator import Simulator
from finger_pin.threads import wait_for
from finger_pin.views.viewer.page_server import open_page

# Height of the page in a notebook, pixels.
_PAGE_HEIGHT = 620
# Time between two updates of the text and the plots, and between two looks for somebody who looks, s.
_REPORT_PERIOD, _IDLE_PERIOD = 0.1, 0.1
# What a press of Step simulates, s.
_STEP_DURATION = 0.02


class Playground:
    """A scenario that is being played; a context manager that ends it.

    Attributes:
        session: The played scenario.
        url: Address of the page.
        playing: Whether time runs.
        rate: Actual simulated seconds per second.
        message: The last one on the page.
    """

    def __init__(self, session: Session, host: str, port: int, folder: Path) -> None:
        """Serve a page and play from a thread."""
        self.session, self.playing, self.message = session, True, ""
        self._folder, self._pacer = folder, Pacer()
        self._jobs: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._closed, self._report_time = threading.Event(), 0.0
        with own_page_only(host):
            self._server = viser.ViserServer(host=host, port=port, label=session.scenario.name, verbose=False)
        self.url = f"http://{host}:{self._server.get_port()}/"
        self._stage = Stage(self._server, session)
        self._panel = Panel(self._server, self, self._stage)
        self._draw()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    @property
    def rate(self) -> float:
        """Actual simulated seconds per second."""
        return self._pacer.rate

    def schedule(self, job: Callable[[], None]) -> None:
        """Run a job between two steps, and show its error if it is refused."""
        self._jobs.put(job)

    def press(self, button: str) -> None:
        """Pause, play, step or reset."""
        if button in (PLAY, PAUSE):
            self.playing = button == PLAY
            self._pacer.restart()
        elif button == STEP:
            self.playing = False
            self._advance(_STEP_DURATION)
        elif button == RESET:
            self.session.reset()
            self._panel.hide_crosses()
            self._panel.update_sliders()

    def set_speed(self, speed: float) -> None:
        """Change the speed of time."""
        self._pacer.speed = speed
        self._pacer.restart()

    def record(self, on: bool) -> None:
        """Start a record, or stop and save it."""
        if on:
            self.session.record()
            self.message = ""
            return
        pieces = self.session.stop()
        self.message = "saving the record ..."
        # A record is simulated again for its signals, which takes about as long, while time runs on.
        threading.Thread(target=self._save, args=(pieces,), daemon=True).start()

    def _save(self, pieces: Sequence[Simulator]) -> None:
        try:
            paths = save_pieces(pieces, self._folder, self.session.scenario.name)
            self.message = f"saved: {', '.join(map(str, paths))}"
        except (FingerPinError, OSError) as error:
            self.message = f"not saved: {error}"
        print(self.message, flush=True)

    def _advance(self, duration: float) -> float:
        """Step by a time, unless that takes too long; return the simulated time, s."""
        period, simulated = self.session.inputs.period, 0.0
        while simulated + 0.999 * period <= duration and not (self.playing and self._pacer.is_late):
            self.session.step()
            simulated += period
        return simulated

    def _run(self) -> None:
        while not self._closed.is_set():
            if not self._server.get_clients():
                # No browser is connected.
                self._pacer.restart()
                self._closed.wait(_IDLE_PERIOD)
                continue
            try:
                self._run_jobs()
                if self.playing:
                    self._pacer.finish_frame(self._advance(self._pacer.start_frame()))
                else:
                    self._pacer.start_frame()
                self._draw()
            except FingerPinError as error:
                self._show_error(str(error), error)
            self._closed.wait(self._pacer.idle_time())

    def _run_jobs(self) -> None:
        """Run the jobs of the page; errors are shown, and playing goes on."""
        with suppress(queue.Empty):
            while True:
                job = self._jobs.get_nowait()
                try:
                    job()
                except FingerPinError as error:
                    self._show_error(str(error), error)
                except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
                    self.message = f"refused: {type(error).__name__}: {error}"

    def _show_error(self, text: str, error: FingerPinError) -> None:
        self.message = text
        # After a failed integration the motion is paused until it is reset.
        self.playing = self.playing and not isinstance(error, RuntimeError)

    def _draw(self) -> None:
        reading, now = self.session.reading(), time.perf_counter()
        with self._server.atomic():
            self._stage.show(reading)
            if now - self._report_time > _REPORT_PERIOD:
                self._report_time = now
                self._panel.show(reading)
                self._panel.report(reading.time, self.rate, self._pacer.is_slow, self.message)

    def wait(self) -> None:
        """Play until the user interrupts (Ctrl-C)."""
        wait_for(self._thread, self.close)

    def close(self) -> None:
        """End the playing; closing twice is allowed."""
        if not self._closed.is_set():
            self._closed.set()
            self._thread.join()
            self._server.stop()

    def __repr__(self) -> str:
        """Return the address."""
        return f"<{type(self).__name__} of {self.session.scenario.name} at {self.url}>"

    def _repr_html_(self) -> str:
        return f'<iframe src="{self.url}" width="100%" height="{_PAGE_HEIGHT}" style="border: none"></iframe>'

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, *error: object) -> None:
        """End the playing."""
        self.close()


def serve(
    session: Session, host: str, port: int, folder: Path, open_browser: bool | None, block: bool | None
) -> Playground:
    """Play a session, as `finger_pin.playground.play` says."""
    playground = Playground(session, host, port, folder)
    if open_page(playground.url, open_browser, block):
        if host not in ("127.0.0.1", "localhost"):
            print(f"Whoever reaches {host} on the network can play too", flush=True)
        print(f"Play at {playground.url} (Ctrl-C ends this)", flush=True)
        playground.wait()
    return playground


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
