"""ROS 2 nodes of midastouch_bringup: thin, no maths."""
