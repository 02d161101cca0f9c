"""Universal Robots arms without their ROS driver, over RTDE."""
