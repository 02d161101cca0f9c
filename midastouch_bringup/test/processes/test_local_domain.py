from midastouch_bringup.processes.local_domain import local_environment, own_domain


def test_nodes_of_our_own_are_heard_on_this_machine_alone(monkeypatch):
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
    monkeypatch.setenv("SOME_OTHER", "stays")
    environment = local_environment(37, ROS_LOG_DIR="here")
    assert environment["ROS_DOMAIN_ID"] == "37"
    assert environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
    assert environment["ROS_LOG_DIR"] == "here"
    assert environment["SOME_OTHER"] == "stays"


def test_the_domain_is_that_of_the_environment_or_one_of_this_process(monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "42")
    assert own_domain() == 42
    monkeypatch.delenv("ROS_DOMAIN_ID")
    assert 1 <= own_domain() <= 101
    assert own_domain() == own_domain()
