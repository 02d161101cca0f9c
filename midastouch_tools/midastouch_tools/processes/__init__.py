"""Nodes as processes of their own: started, watched, ended, and their parameter files; without ROS."""
