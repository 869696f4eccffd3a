"""Robots that speak ROS 2: Nav2's actions drive the legs, and a service or action takes the scans.

ros_port       interfaces to ROS: what drives and scans, and the node that speaks for it
ros_telemetry  poses of tf, odometry, their ages, jumps and clocks
goal_drive     drives one straight by one goal, and judges its end by the pose
ros_base       `RosBase`: the base of a robot's controller
ros_scanner    `RosScanner`: its scanner
nav2_port      goals, scans and telemetry of a robot with Nav2, on any node
rclpy_node     the node by rclpy; the only module that imports ROS
zenoh_node     the node over zenoh, without ROS; ros_definitions has its types
zenoh_robot    opens it for a robot, with its guard; drive_lease is the guard at the robot
"""
