"""Work shared out to processes of this machine, and how they end."""

import os
import signal
import subprocess
import sys
import time

import pytest

from midastouch_common.errors import InputError
from midastouch_common.files import require_place
from midastouch_tools.jobs import open_workers


@pytest.mark.parametrize("jobs", [1, 2])
def test_nothing_is_started_after_the_deadline(jobs):
    with open_workers(jobs) as workers:
        assert list(workers.map(abs, [(-1,)], deadline=time.monotonic() - 1)) == []
        assert sorted(workers.map(abs, [(-k,) for k in range(12)])) == list(range(12))


def test_a_killed_worker_is_said():
    with pytest.raises(InputError, match=r"a worker process died; .*--jobs"), open_workers(2) as workers:
        list(workers.map(signal.raise_signal, [(signal.SIGKILL,)]))


def test_an_error_of_a_task_is_raised_here_and_ends_the_others():
    began = time.monotonic()
    with pytest.raises(ValueError, match="non-negative"), open_workers(2) as workers:
        list(workers.map(time.sleep, [(600,), (-1,)]))
    assert time.monotonic() - began < 300


def test_libraries_of_workers_use_one_thread_unless_told_otherwise(monkeypatch):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "3")
    with open_workers(2) as workers:
        assert sorted(workers.map(os.getenv, [("OMP_NUM_THREADS",), ("OPENBLAS_NUM_THREADS",)])) == ["1", "3"]
        with pytest.raises(InputError, match="/: no file"):
            list(workers.map(require_place, [("/",)]))
    assert "OMP_NUM_THREADS" not in os.environ


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_workers_end_with_their_parent(number, tmp_path):
    (tmp_path / "lasting.py").write_text(
        "import os, signal, time\nfrom midastouch_tools.jobs import open_workers\n"
        "def work(k):\n    os.write(1, b'.')\n    time.sleep(90)\n"
        "if __name__ == '__main__':\n    signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "    with open_workers(2) as workers:\n        list(workers.map(work, [(k,) for k in range(9)]))\n"
    )
    command = [sys.executable, tmp_path / "lasting.py"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as parent:
        assert parent.stdout.read(2) == b".."
        parent.send_signal(number)
        # the end of the pipe comes when the last process that can write into it is gone
        assert parent.communicate(timeout=60)[0] == b""
    assert parent.returncode == -number
