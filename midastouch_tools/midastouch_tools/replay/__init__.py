"""Playing of a recording, without ROS: its messages, their timing, and the wait for the filter's answers."""
