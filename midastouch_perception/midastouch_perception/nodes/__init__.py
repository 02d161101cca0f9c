"""ROS 2 nodes of midastouch_perception; they are thin and contain no maths."""
