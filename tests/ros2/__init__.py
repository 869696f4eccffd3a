"""Tests with a real ROS 2, where its environment is there (`make ros2`)."""
