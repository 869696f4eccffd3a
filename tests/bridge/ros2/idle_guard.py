"""A stand-in for the guard's process, without ROS: it is there at once, and ends with its input."""

import sys

print("ready", flush=True)
sys.stdin.read()
