"""Code that needs ROS and is no node: runs of nodes that a command starts and watches."""
