import subprocess
import sys

from midastouch_tools.processes.local_domain import claimed_domain, local_environment, own_domain


def test_nodes_of_our_own_are_heard_on_this_machine_alone(monkeypatch):
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
    monkeypatch.setenv("SOME_OTHER", "stays")
    environment = local_environment(37, ROS_LOG_DIR="here")
    assert environment["ROS_DOMAIN_ID"] == "37"
    assert environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
    assert environment["ROS_LOG_DIR"] == "here"
    assert environment["SOME_OTHER"] == "stays"


def test_the_domain_is_the_environment_s_or_a_claimed_one(monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "42")
    assert own_domain() == 42
    monkeypatch.delenv("ROS_DOMAIN_ID")
    assert own_domain() == claimed_domain()


def test_no_two_processes_claim_the_same_domain():
    claim = "from midastouch_tools.processes.local_domain import claimed_domain; print(claimed_domain(), flush=True)"
    others = [
        subprocess.Popen(
            [sys.executable, "-c", f"{claim}; input()"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        for _ in range(2)
    ]
    domains = [claimed_domain(), *(int(other.stdout.readline()) for other in others)]
    for other in others:
        other.communicate("done\n")
    assert len(set(domains)) == 3
    assert all(1 <= domain <= 101 for domain in domains)
