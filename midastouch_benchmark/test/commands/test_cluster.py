"""Work shared out to a cluster, and what a dead worker leaves behind."""

import sys
import time

import pytest

from midastouch_benchmark.commands.options import open_cluster
from midastouch_common.errors import InputError
from midastouch_common.missing_modules import install_extra


@pytest.fixture
def distributed():
    return pytest.importorskip("distributed", reason="needs Dask: pip install -r tools/requirements/cluster.txt")


def test_a_killed_worker_loses_nothing_and_nothing_comes_twice(distributed, tmp_path):
    # cloudpickle sends what is defined in here by value: workers need not find this file
    def square(k: int) -> int:
        import signal

        if k == 5 and not (tmp_path / "died").is_file():
            (tmp_path / "died").touch()
            signal.raise_signal(signal.SIGKILL)
        return k**2

    local = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0", silence_logs="CRITICAL"
    )
    with local, open_cluster(local.scheduler_address) as workers:
        assert sorted(workers.map(square, [(k,) for k in range(12)])) == [k**2 for k in range(12)]
        assert list(workers.map(abs, [(-1,)], deadline=time.monotonic() - 1)) == []
    assert (tmp_path / "died").is_file()


def test_an_address_where_nobody_answers_is_said(distributed, monkeypatch):
    monkeypatch.setattr("midastouch_benchmark.commands.options.CONNECT_S", 0.5)
    with pytest.raises(InputError, match=r"tcp://127\.0\.0\.1:9"), open_cluster("tcp://127.0.0.1:9"):
        pass


def test_without_dask_the_command_that_installs_it_is_said(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError) as error, open_cluster("tcp://127.0.0.1:9"):
        pass
    assert install_extra("cluster") in str(error.value)
