"""All that our nodes take from rclpy without it being public there, each with its reason."""

from rclpy.impl.implementation_singleton import rclpy_implementation

RCLError = rclpy_implementation.RCLError
"""What publishers raise once a signal has shut down their context. rclpy does not export it (ros2/rclpy#31)."""
