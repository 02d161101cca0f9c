"""Work shared out, and what a dead worker leaves behind."""

import os
import signal
import threading
import time
from pathlib import Path

import pytest

from midastouch_common.errors import InputError
from midastouch_tools.cluster import open_cluster


def squares_of(folder: Path):
    """Task k -> k squared: notes its process in the folder, and waits there for the file `go`."""

    # cloudpickle sends what is defined in here by value: workers need not find this file
    def square(k: int) -> int:
        import os
        import time

        with (folder / str(k)).open("a") as started:
            started.write(f"{os.getpid()}\n")
        while not (folder / "go").is_file():
            time.sleep(0.01)
        return k**2

    return square


def wait_for(holds) -> None:
    limit = time.monotonic() + 60
    while not holds():
        assert time.monotonic() < limit, "nothing happens any more"
        time.sleep(0.01)


def test_a_killed_worker_loses_nothing_and_nothing_comes_twice(tmp_path):
    results = []
    with open_cluster(jobs=2) as cluster:
        square, arguments = squares_of(tmp_path), [(k,) for k in range(12)]
        stream = cluster.map(square, arguments)

        def started() -> list[Path]:
            return [path for path in tmp_path.iterdir() if path.read_text()]

        collecting = threading.Thread(target=lambda: results.extend(stream))
        collecting.start()
        wait_for(lambda: len(started()) == 2)
        victim, other = (int(path.read_text()) for path in started())
        assert len({victim, other, os.getpid()}) == 3
        os.kill(victim, signal.SIGKILL)
        (tmp_path / "go").touch()
        collecting.join(60)
    assert sorted(results) == [k**2 for k in range(12)]
    starts = [len(path.read_text().split()) for path in tmp_path.iterdir() if path.name != "go"]
    assert sum(starts) == 12 + 1  # the one that died in the victim's hands was started again


@pytest.mark.parametrize("jobs", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_nothing_is_started_after_the_deadline(jobs):
    with open_cluster(jobs) as cluster:
        assert list(cluster.map(abs, [(-1,)], deadline=time.monotonic() - 1)) == []
        assert sorted(cluster.map(abs, [(-1,), (2,)])) == [1, 2]


def test_an_address_where_nobody_answers_is_said(monkeypatch):
    monkeypatch.setattr("midastouch_tools.cluster.CONNECT_S", 0.5)
    with (
        pytest.raises(InputError, match=r"tcp://127\.0\.0\.1:9"),
        open_cluster(1, "tcp://127.0.0.1:9"),
    ):
        pass


def test_workers_keep_memory_that_they_will_need_again():
    def pages_taken() -> int:
        import resource

        import numpy as np

        def taken() -> int:
            before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
            for _ in range(200):
                np.ones((320, 240, 3), np.float32)
            return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

        taken()
        return taken()

    of_one_array = 320 * 240 * 3 * 4 // 4096
    with open_cluster(jobs=2) as cluster:
        assert all(taken < 20 * of_one_array for taken in cluster.map(pages_taken, [(), ()]))
