"""A server for one page, on the loopback address only, that can push messages to it."""

from __future__ import annotations

import threading
from collections import deque
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

#: Messages kept for a page that is opened late; a quarter of an hour at 30 per second.
KEPT_MESSAGES = 27_000
#: Time after which a silent stream is checked for a reader, s, and time that closing waits for readers, s.
_HEARTBEAT, _FAREWELL = 15.0, 2.0


class PageServer:
    """Serves a page at ``/`` and, if it is live, a stream of messages at ``/frames`` (server-sent events).

    Attributes:
        url: Address of the page.
    """

    def __init__(self, page: str, *, live: bool = False) -> None:
        """Serve a page from a thread of its own.

        Args:
            page: HTML text.
            live: Whether there is a stream of messages.
        """
        self._page = page.encode()
        self._live = live
        self._messages: deque[str] = deque(maxlen=KEPT_MESSAGES)
        self._published = 0
        self._readers = 0
        self._closed = False
        self._changed = threading.Condition()
        self._server = ThreadingHTTPServer(("127.0.0.1", 0), self._handler())
        self._hosts = {f"{host}:{self._server.server_port}" for host in ("127.0.0.1", "localhost")}
        self.url = f"http://127.0.0.1:{self._server.server_port}/"
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.05,), daemon=True)
        self._thread.start()

    def publish(self, message: str) -> None:
        """Send one line of text to all pages, and to those that are opened later."""
        with self._changed:
            self._messages.append(message)
            self._published += 1
            self._changed.notify_all()

    def join(self) -> None:
        """Wait until the server is closed from elsewhere."""
        while self._thread.is_alive():
            self._thread.join(0.2)

    def close(self) -> None:
        """Tell the pages that nothing more comes, and stop. Closing twice is allowed."""
        with self._changed:
            if self._closed:
                return
            self._closed = True
            self._changed.notify_all()
            self._changed.wait_for(lambda: self._readers == 0, timeout=_FAREWELL)
        self._server.shutdown()
        self._thread.join()
        self._server.server_close()

    def _stream(self, handler: BaseHTTPRequestHandler) -> None:
        with self._changed:
            self._readers += 1
        try:
            sent, over = 0, False
            while not over:
                with self._changed:
                    if self._published == sent and not self._closed:
                        self._changed.wait(_HEARTBEAT)
                    fresh = list(self._messages)[max(0, len(self._messages) - (self._published - sent)) :]
                    sent, over = self._published, self._closed
                text = "".join(f"data: {message}\n\n" for message in fresh) or ": quiet\n\n"
                handler.wfile.write((text + ("event: end\ndata: \n\n" if over else "")).encode())
                handler.wfile.flush()
        except OSError:
            pass  # The reader has gone.
        finally:
            with self._changed:
                self._readers -= 1
                self._changed.notify_all()

    def _handler(self) -> type[BaseHTTPRequestHandler]:
        server = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                # Another site's name that resolves to the loopback address must not read from here.
                if self.headers.get("Host") not in server._hosts:
                    self.send_error(403)
                elif self.path == "/":
                    self._head("text/html; charset=utf-8", len(server._page))
                    self.wfile.write(server._page)
                elif self.path == "/frames" and server._live:
                    self._head("text/event-stream")
                    server._stream(self)
                else:
                    self.send_error(404)

            def _head(self, kind: str, length: int | None = None) -> None:
                self.send_response(200)
                self.send_header("Content-Type", kind)
                self.send_header("Cache-Control", "no-store")
                if length is not None:
                    self.send_header("Content-Length", str(length))
                self.end_headers()

            def log_message(self, format: str, *args: object) -> None:
                pass

        return Handler
