"""A stand-in for the guard's process, without ROS: it answers, and ends with its input.

It takes its time to be ready if it is given a file to write before.
"""

import json
import os
import sys
import time
from pathlib import Path

from stopgo.bridge.ros2.goal_guard import ANSWER, MOST_BYTES, READY

if "marks" in (wanted := json.loads(sys.argv[1])):
    time.sleep(0.5)
    Path(wanted["marks"]).touch()
os.write(sys.stdout.fileno(), READY)
while signs := os.read(sys.stdin.fileno(), MOST_BYTES):
    os.write(sys.stdout.fileno(), ANSWER * len(signs))
