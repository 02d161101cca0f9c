"""ROS 2 nodes of digit_driver: thin, no maths."""
