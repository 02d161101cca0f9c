"""Rerun's own server for browsers, as a separate process: the SDK's built-in one listens to the whole network."""

from __future__ import annotations

import ipaddress
import os
import socket
import subprocess
import time
from pathlib import Path
from tempfile import TemporaryFile
from urllib.parse import quote

from midastouch_common.errors import InputError
from midastouch_common.stop_signals import bound_to_us

from . import require_rerun

OFFLINE_ENVIRONMENT = {"CI": "1"}
"""Keeps Rerun's programs from reporting their use to its makers: there is no other variable for that."""

OFFLINE_QUERY = "notebook=1&hide_welcome_screen=1"
"""Keeps Rerun's page from reporting as well, and from fetching examples from its makers."""

_START_S = 30.0
_STOP_S = 5.0


class ViewServer:
    """Server of the viewer's page on `web_port` and of its data on `port` of `host`; `with` stops it.

    memory_mb: data kept for browsers that connect late; the oldest goes first. Raises InputError if it cannot start,
    such as on a port in use.
    """

    def __init__(self, host: str, port: int, web_port: int, memory_mb: int):
        require_rerun()
        import rerun_cli

        try:
            ipaddress.ip_address(host)
        except ValueError as error:
            raise InputError(
                f"--host {host}: not an IP address; 127.0.0.1 is this machine, 0.0.0.0 all networks"
            ) from error
        self._host, self._port, self._web_port = host, port, web_port
        for taken in (port, web_port):
            _require_free(host, taken)
        # The binary itself: the `rerun` script is a Python process that would outlive it, or the other way round.
        binary = Path(rerun_cli.__file__).parent / "rerun"
        command: list[str | os.PathLike] = [binary, "--serve-web", "--bind", host, "--port", str(port)]
        command += ["--web-viewer-port", str(web_port), "--server-memory-limit", f"{memory_mb}MB", "--newest-first"]
        if not ipaddress.ip_address(host).is_loopback:
            # The page and the data have different ports, and so different origins to a browser.
            command += ["--cors-allow-origin", f"http://*:{web_port}"]
        self._log = TemporaryFile()  # noqa: SIM115 - closed in close()
        self._process = subprocess.Popen(
            bound_to_us(command),
            stdin=subprocess.DEVNULL,
            stdout=self._log,
            stderr=self._log,
            start_new_session=True,
            env={**os.environ, **OFFLINE_ENVIRONMENT},
        )
        try:
            self._wait_until_it_listens()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> ViewServer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def address(self) -> str:
        """Address to which data is sent, and from which it is fetched."""
        return f"rerun+http://{self._reachable()}:{self._port}/proxy"

    @property
    def page(self) -> str:
        """Address to open in a browser, as seen from this machine or, if served to all, from others."""
        shown = socket.gethostname() if _is_everywhere(self._host) else self._host
        data = quote(f"rerun+http://{shown}:{self._port}/proxy", safe="")
        return f"http://{shown}:{self._web_port}/?url={data}&{OFFLINE_QUERY}"

    def close(self) -> None:
        """Stop serving."""
        self._process.terminate()
        try:
            self._process.wait(_STOP_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._log.close()

    def _reachable(self) -> str:
        return "127.0.0.1" if _is_everywhere(self._host) else self._host

    def _wait_until_it_listens(self) -> None:
        deadline = time.monotonic() + _START_S
        while not all(_listens(self._reachable(), port) for port in (self._port, self._web_port)):
            if self._process.poll() is not None or time.monotonic() > deadline:
                self._log.seek(0)
                said = self._log.read().decode(errors="replace").strip().splitlines()
                raise InputError(f"the view's server did not start: {said[-1] if said else 'it said nothing'}")
            time.sleep(0.05)


def _is_everywhere(host: str) -> bool:
    return ipaddress.ip_address(host).is_unspecified


def _require_free(host: str, port: int) -> None:
    """Raise InputError if the port is taken: Rerun would hand our data to the program that listens there."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            raise InputError(
                f"{host} port {port}: {error.strerror}; choose another --host, --port or --web-port"
            ) from error


def _listens(host: str, port: int) -> bool:
    try:
        with socket.create_connection((host, port), timeout=1.0):
            return True
    except OSError:
        return False
