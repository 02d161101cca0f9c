#!/usr/bin/env bash
# Puts ROS 2 and this workspace on the paths, then becomes the command.
set -e
source /opt/ros/jazzy/setup.bash
source /opt/midastouch/setup.bash
exec "$@"
