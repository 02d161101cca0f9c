"""A server of files on this machine, with the faults of the real ones."""

from __future__ import annotations

import hashlib
import re
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest


class FileServer:
    """Serves `files` ({path: bytes}) and notes each request.

    break_after: bytes after which the next responses end, one entry per response; fail: statuses of the next ones.
    ranges: whether it understands them; etag: whether it names versions.
    """

    def __init__(self) -> None:
        self.files: dict[str, bytes] = {}
        self.requests: list[tuple[str, str | None]] = []
        self.break_after: list[int] = []
        self.fail: list[int] = []
        self.ranges = self.etag = True
        self.wrong_range = False
        outer = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                outer.answer(self)

            def log_message(self, *_: object) -> None:
                pass

        self._http = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self._http.server_port}"
        self._thread = threading.Thread(target=self._http.serve_forever, args=(0.02,), daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._http.shutdown()
        self._http.server_close()
        self._thread.join()

    @property
    def ranges_asked(self) -> list[str | None]:
        return [asked for _, asked in self.requests]

    def answer(self, handler: BaseHTTPRequestHandler) -> None:
        asked = handler.headers.get("Range")
        self.requests.append((handler.path, asked))
        if self.fail:
            handler.send_error(self.fail.pop(0))
            return
        if handler.path not in self.files:
            handler.send_error(404)
            return
        data = self.files[handler.path]
        tag = f'"{hashlib.sha256(data).hexdigest()[:16]}"'
        start = int(re.fullmatch(r"bytes=(\d+)-", asked)[1]) if asked else 0
        if not self.ranges or (asked and handler.headers.get("If-Range") != tag):
            start, asked = 0, None
        if asked and start >= len(data):
            handler.send_error(416)
            return
        handler.send_response(206 if asked else 200)
        if asked:
            first = start + 1 if self.wrong_range else start
            handler.send_header("Content-Range", f"bytes {first}-{len(data) - 1}/{len(data)}")
        if self.etag:
            handler.send_header("ETag", tag)
        handler.send_header("Content-Length", str(len(data) - start))
        handler.end_headers()
        end = start + self.break_after.pop(0) if self.break_after else len(data)
        handler.wfile.write(data[start:end])


@pytest.fixture
def server() -> Iterator[FileServer]:
    running = FileServer()
    yield running
    running.close()
