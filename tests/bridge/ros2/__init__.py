"""Tests of bridge/ros2; real ROS only in test_real_nav2."""
