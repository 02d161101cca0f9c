"""Nothing leaves the machine unasked: what Rerun's server and its page are given, by a stand-in of the server."""

import sys
from types import ModuleType
from urllib.parse import parse_qs, urlsplit

import pytest
from ports import free_ports

from midastouch_tools.view.server import ViewServer

PROGRAM = """#!{python}
import os, pathlib, signal, socket, sys
given = dict(zip(sys.argv, sys.argv[1:]))
pathlib.Path({seen!r}).write_text(os.environ.get("CI", ""))
listening = [socket.create_server((given["--bind"], int(given[name]))) for name in ("--port", "--web-viewer-port")]
signal.pause()
"""


@pytest.fixture
def seen(tmp_path, monkeypatch):
    """What the program saw of the variable that Rerun's programs look at, in a file."""
    seen = tmp_path / "seen"
    for name in "rerun", "rerun_cli":
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
    sys.modules["rerun_cli"].__file__ = str(tmp_path / "__init__.py")
    program = tmp_path / "rerun"
    program.write_text(PROGRAM.format(python=sys.executable, seen=str(seen)))
    program.chmod(0o755)
    monkeypatch.delenv("CI", raising=False)
    return seen


def test_rerun_is_kept_from_calling_its_makers(seen):
    ports = free_ports(2)
    with ViewServer("127.0.0.1", *ports, 100) as server:
        page = parse_qs(urlsplit(server.page).query)
    assert seen.read_text() == "1"
    assert page == {
        "url": [f"rerun+http://127.0.0.1:{ports[0]}/proxy"],
        "notebook": ["1"],
        "hide_welcome_screen": ["1"],
    }
