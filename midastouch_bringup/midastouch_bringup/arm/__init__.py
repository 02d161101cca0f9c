"""A robot arm that carries the sensor: its poses, clock and mount; without ROS."""
