"""Recordings: sequences as ROS messages, rosbag2 files, and what is read from them; without ROS."""
