"""An autopilot as the base and scanner of a robot, driven leg by leg by the robot's controller."""
