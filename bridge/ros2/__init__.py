"""Robots that speak ROS 2: Nav2's actions drive the legs, and a service or action takes the scans.

ros_port       interfaces to ROS: goals, calls of the scanner, and what a robot's computer offers
ros_telemetry  poses of tf, odometry, their ages, jumps and clocks
goal_drive     drives one straight by one goal, and judges its end by the pose
ros_base       `RosBase`: the base of a robot's controller
ros_scanner    `RosScanner`: its scanner
rclpy_port     the only module that imports ROS
"""
