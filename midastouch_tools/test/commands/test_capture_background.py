"""`midastouch capture-background` beside a node that has the service."""

import os
import subprocess
import sys
import threading

import pytest
from std_srvs.srv import Trigger

from midastouch_common.errors import InputError
from midastouch_tools import cli
from midastouch_tools.ros.local_context import trigger

pytestmark = pytest.mark.dds


@pytest.mark.parametrize(("taken", "code"), [(True, 0), (False, 1)])
def test_the_answer_is_told(graph, capsys, taken, code):
    def answer(_, response):
        response.success, response.message = taken, "in words"
        return response

    graph.companion.create_service(Trigger, "capture_background", answer)
    done = []
    caller = threading.Thread(target=lambda: done.append(cli.main(["capture-background"])))
    caller.start()
    graph.spin_until(lambda: done, "the command's end")
    caller.join()
    assert done == [code]
    assert capsys.readouterr().out == "in words\n"


def test_a_service_that_nobody_offers_is_named(graph):
    with pytest.raises(InputError, match=r"/left/capture_background.*--namespace"):
        trigger("capture_background", "midastouch run perception", "left", timeout=0.2)


def test_where_ros_does_not_start_that_is_said(tmp_path):
    (tmp_path / "a_file").touch()
    done = subprocess.run(
        [sys.executable, "-m", "midastouch_tools.cli", "capture-background"],
        env={**os.environ, "ROS_LOG_DIR": str(tmp_path / "a_file" / "logs")},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2, done.stderr
    assert done.stderr.splitlines()[-1].startswith("midastouch: error: ROS does not start: ")
    assert "Traceback" not in done.stderr
