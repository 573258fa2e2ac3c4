"""A ROS 2 node that estimates the soil under a wheel."""
