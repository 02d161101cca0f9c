"""The sensor's mount on a robot arm, without ROS."""
