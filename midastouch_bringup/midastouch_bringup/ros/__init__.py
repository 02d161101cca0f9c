"""What needs ROS and is no node: the parts of the launch files."""
