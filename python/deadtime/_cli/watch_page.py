"""The page of ``deadtime watch``, served to this computer alone."""

from __future__ import annotations

import json
import threading
from collections import deque
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from deadtime._base.page import page
from deadtime.estimation import OnlineEstimate

#: The newest estimates that the page shows.
SHOWN = 3000

#: Names by which this computer may be asked.
OWN_NAMES = ("127.0.0.1", "localhost")


class WatchPage:
    """Serves a page with the newest estimates on a free port of the loopback address."""

    def __init__(self, source: str) -> None:
        text = page(
            "_cli/watch.html",
            title="The delay now",
            described=source,
            verdict="Waiting for rows.",
        )
        self._estimates: deque[OnlineEstimate] = deque(maxlen=SHOWN)
        self._lock = threading.Lock()
        outer = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                name = self.headers.get("Host", "").rpartition(":")[0]
                if name not in OWN_NAMES:
                    self.send_error(403)
                elif self.path == "/":
                    self._answer("text/html; charset=utf-8", text)
                elif self.path == "/track":
                    self._answer("application/json", outer._track())
                else:
                    self.send_error(404)

            def _answer(self, kind: str, body: str) -> None:
                data = body.encode()
                self.send_response(200)
                self.send_header("Content-Type", kind)
                self.send_header("Content-Length", str(len(data)))
                self.send_header("Cache-Control", "no-store")
                self.end_headers()
                self.wfile.write(data)

            def log_message(self, *_: object) -> None:
                """Print nothing: the terminal shows the estimates."""

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self._server.daemon_threads = True
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    @property
    def address(self) -> str:
        """Where the page is."""
        return f"http://127.0.0.1:{self._server.server_port}/"

    def show(self, estimate: OnlineEstimate) -> None:
        """Add an estimate."""
        with self._lock:
            self._estimates.append(estimate)

    def close(self) -> None:
        """Serve nothing any more."""
        self._server.shutdown()
        self._server.server_close()

    def _track(self) -> str:
        with self._lock:
            found = list(self._estimates)
        rows = [
            [e.time, e.delay, *e.ci, e.known, e.changed, e.verdict == "reliable"] for e in found
        ]
        return json.dumps({"rows": rows, "said": str(found[-1]) if found else ""})
