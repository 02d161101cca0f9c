"""How a recording is played: what is sent, when, and who is waited for; without ROS."""
