"""ROS 2 nodes of midastouch_filter: thin, no maths."""
