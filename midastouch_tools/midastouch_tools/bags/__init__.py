"""Recordings, without ROS: sequences as ROS messages, rosbag2 files, and the frames and runs read from them."""
