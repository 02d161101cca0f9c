"""What our launch files use of ROS 2's launch_ros, with the same names and arguments (tests/facts/launch.yaml)."""
