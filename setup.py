"""Where the four folders go when stopgo is installed: below `_stopgo`, as their names are common ones.

`pip install mission` would write over a folder `mission` beside it. Whoever imports stopgo finds the four
under their own names all the same (`_own_folders_first` in stopgo.py). An editable install leaves them where
they are.
"""

import sys

from setuptools import find_packages, setup

FOLDERS = ("mission", "planner", "bridge", "recordings")

found = find_packages(include=[f"{folder}*" for folder in FOLDERS])
if "editable_wheel" in sys.argv:
    setup(packages=found)
else:
    setup(
        packages=[f"_stopgo.{name}" for name in found],
        package_dir={f"_stopgo.{folder}": folder for folder in FOLDERS},
    )
