"""Code that needs ROS and is no node: parts of the launch files, set-ups, and runs of the nodes."""
