"""Where the folders of the tree go when stopgo is installed: below `stopgo`, the one name that it takes.

The links `stopgo/mission -> ../mission` and so on say the same to mypy and editors. The build does not follow
them, so that it also works where a checkout has no links, as on Windows.
"""

from setuptools import find_packages, setup

FOLDERS = ("mission", "planner", "bridge", "recordings")

linked = [f"stopgo.{folder}{below}" for folder in FOLDERS for below in ("", ".*")]
own = find_packages(include=["stopgo", "stopgo.*"], exclude=linked)
mapped = [f"stopgo.{name}" for folder in FOLDERS for name in find_packages(include=[folder, f"{folder}.*"])]
setup(packages=[*own, *mapped], package_dir={f"stopgo.{folder}": folder for folder in FOLDERS})
