"""`midastouch capture-background` beside a node that has the service."""

import threading

import pytest
from std_srvs.srv import Trigger

from midastouch_bringup import cli
from midastouch_bringup.ros.local_context import trigger
from midastouch_common.errors import InputError

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
        trigger("capture_background", "left", timeout=0.2)
