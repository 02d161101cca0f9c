"""ROS 2 nodes of midastouch_perception: thin, no maths."""
