"""The options of the bridge's commands; each is declared once, so its help text is the same everywhere."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
CONNECTION, VEHICLE, SIMULATION = "Connection", "MAVLink vehicle", "Simulation"
"""Groups of the options in the help."""

# The connection to a robot or a vehicle

RobotName = Annotated[
    str, typer.Option("--robot", metavar="NAME", rich_help_panel=CONNECTION, help="Name of the robot.")
]
AnyRobot = Annotated[
    str | None, typer.Option("--robot", metavar="NAME", rich_help_panel=CONNECTION, help="Name of the robot.")
]
RobotOrAll = Annotated[
    str | None,
    typer.Option(
        "--robot", metavar="NAME", rich_help_panel=CONNECTION, help="Name of the robot; all if not given."
    ),
]
AllRobots = Annotated[
    bool, typer.Option("--all", rich_help_panel=CONNECTION, help="All robots, even if one is preset.")
]
Connect = Annotated[
    str,
    typer.Option(
        "--connect",
        metavar="ENDPOINT",
        rich_help_panel=CONNECTION,
        help="Endpoint of the robot or router, as tcp/127.0.0.1:7447; several: A,B.",
    ),
]
SiteName = Annotated[
    str | None,
    typer.Option(
        "--site", metavar="NAME", rich_help_panel=CONNECTION, help="Key-expression prefix of the site."
    ),
]
As = Annotated[
    str | None,
    typer.Option(
        "--as",
        metavar="WHO",
        rich_help_panel=CONNECTION,
        help="Name of the operator; user@host if not given.",
    ),
]
Timeout = Annotated[
    float,
    typer.Option(
        "--timeout",
        min=0.1,
        max=1e6,
        metavar="S",
        rich_help_panel=CONNECTION,
        help="Longest wait for an answer, in seconds.",
    ),
]
PushTimeout = Annotated[
    float | None,
    typer.Option(
        "--timeout",
        min=0.1,
        max=1e6,
        metavar="S",
        rich_help_panel=CONNECTION,
        help="Longest wait without an answer, in seconds; if not given, 5 to find the robot and 20 for each"
        " chunk.",
    ),
]
Insecure = Annotated[
    bool,
    typer.Option(
        "--insecure",
        rich_help_panel=CONNECTION,
        help="Allow addresses beyond this machine without keys or signing.",
    ),
]
KeyFolder = Annotated[
    Path | None,
    typer.Option(
        "--keys",
        metavar="DIR",
        rich_help_panel=CONNECTION,
        help="Folder of the keys that stopgo keys issued.",
    ),
]
OtherKeyFolder = Annotated[
    Path | None,
    typer.Option(
        "--other-keys",
        metavar="DIR",
        rich_help_panel=CONNECTION,
        help="Keys of a second station, to test the commander's lease.",
    ),
]
MavlinkUrl = Annotated[
    str | None,
    typer.Option(
        "--mavlink",
        metavar="URL",
        rich_help_panel=VEHICLE,
        help="A vehicle instead, such as udpout:127.0.0.1:14550.",
    ),
]
RosDomain = Annotated[
    str | None,
    typer.Option(
        "--ros2",
        metavar="DOMAIN[/NS]",
        rich_help_panel=CONNECTION,
        help="Topics of a ROS 2 robot instead, over rmw_zenoh at --connect; behind a DDS bridge: dds/NS.",
    ),
]
RequiredRosDomain = Annotated[
    str,
    typer.Option(
        "--ros2",
        metavar="DOMAIN[/NS]",
        rich_help_panel=CONNECTION,
        help="Domain and namespace of the robot's node.",
    ),
]
GuardedRouter = Annotated[
    str,
    typer.Option(
        "--connect",
        metavar="ENDPOINT",
        rich_help_panel=CONNECTION,
        help="The zenoh router of the robot's ROS 2 network.",
    ),
]
GuardedNode = Annotated[
    str,
    typer.Option(
        "--node",
        metavar="NAME",
        rich_help_panel=CONNECTION,
        help="Name of the node that drives: `node` of its ros2.toml.",
    ),
]
RequiredMavlinkUrl = Annotated[
    str,
    typer.Option(
        "--mavlink",
        metavar="URL",
        rich_help_panel=CONNECTION,
        help="A vehicle, such as tcp:127.0.0.1:5760 or serial:/dev/ttyUSB0:57600.",
    ),
]
VehicleId = Annotated[
    int | None,
    typer.Option(
        "--vehicle",
        metavar="ID",
        min=1,
        max=255,
        rich_help_panel=VEHICLE,
        help="Its system id, if there are several.",
    ),
]
SigningKey = Annotated[
    Path | None,
    typer.Option(
        "--signing-key",
        metavar="FILE",
        rich_help_panel=VEHICLE,
        help="Sign MAVLink messages; FILE: 64 hex digits or a passphrase of at least 8 characters.",
    ),
]
StateFolder = Annotated[
    Path | None,
    typer.Option(
        "--state",
        metavar="DIR",
        rich_help_panel=VEHICLE,
        help="Folder for what must outlast a restart; one per vehicle.",
    ),
]

# Output

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")]

# Commands to a robot

TakeOver = Annotated[bool, typer.Option("--take-over", help="Take control from another operator.")]
StopId = Annotated[
    str | None, typer.Option("--stop", metavar="ID", help="Scan stop that the command is meant for.")
]
Again = Annotated[bool, typer.Option("--again", help="Run a mission that was run before.")]
FromHere = Annotated[bool, typer.Option("--from-here", help="Start at the nearest point of the route.")]
Arm = Annotated[bool, typer.Option("--arm", rich_help_panel=VEHICLE, help="Arm a vehicle that is disarmed.")]
Disarm = Annotated[
    bool, typer.Option("--disarm", rich_help_panel=VEHICLE, help="Disarm a vehicle at standstill.")
]
AnyOrigin = Annotated[
    bool,
    typer.Option(
        "--skip-origin-check",
        rich_help_panel=VEHICLE,
        help="Skip the origin check: the vehicle has satellite positions.",
    ),
]
Roster = Annotated[
    Path | None,
    typer.Option(
        "--roster",
        metavar="FILE.toml",
        help="File with expected robots: robots = [...]; else all that ever answered.",
    ),
]
Forget = Annotated[
    list[str] | None,
    typer.Option("--forget", metavar="NAME", help="Remove a robot from the expected ones; repeatable."),
]

# Missions

MissionToPush = Annotated[Path, typer.Argument(metavar="MISSION.json", help="The mission to send.")]
FetchedFile = Annotated[
    Path | None,
    typer.Option("-o", "--out", metavar="FILE", help="File to write: *.json, *.plan, *.waypoints."),
]
AutopilotKind = Annotated[
    str | None,
    typer.Option(
        "--autopilot",
        metavar="ardupilot|px4|generic",
        rich_help_panel=VEHICLE,
        help="Kind of autopilot, if not that of its heartbeat.",
    ),
]
ItemTrigger = Annotated[
    str | None,
    typer.Option(
        "--trigger",
        metavar="auto|script|camera|none",
        rich_help_panel=VEHICLE,
        help="Item that makes the vehicle scan.",
    ),
]
ScanWaiting = Annotated[
    str | None,
    typer.Option(
        "--scan-wait",
        metavar="delay|script_time",
        rich_help_panel=VEHICLE,
        help="Wait the planned time, or until a script reports.",
    ),
]
Settling = Annotated[
    str | None,
    typer.Option(
        "--settle-item",
        metavar="delay|hold",
        rich_help_panel=VEHICLE,
        help="Settle in a delay item, or as the hold of a waypoint.",
    ),
]
SetOrigin = Annotated[
    bool,
    typer.Option(
        "--set-origin", rich_help_panel=VEHICLE, help="Give a vehicle without an origin the mission's."
    ),
]
WhileRunning = Annotated[
    bool,
    typer.Option(
        "--while-running",
        rich_help_panel=VEHICLE,
        help="Allow it while the vehicle follows its mission, or its run is not over.",
    ),
]

# Following a run

RunRecordingFile = Annotated[
    Path | None, typer.Option("--rrd", metavar="FIELD.rrd", help="Record the run for Rerun.")
]
PlanRecordingFile = Annotated[
    Path | None,
    typer.Option("--plan", metavar="PLAN.rrd", help="The plan's recording, with floor and visibility."),
]
FinishedRun = Annotated[
    str | None,
    typer.Option("--run", metavar="RUN_ID", help="A finished run, read from the robot's telemetry log."),
]
View = Annotated[bool, typer.Option("--view", help="Open the viewer on the recording.")]

# A robot, and what simulates one

OwnName = Annotated[str, typer.Option("--name", metavar="NAME", help="Name of this robot.")]
Listen = Annotated[str, typer.Option("--listen", metavar="ENDPOINT", help="Endpoint to listen on.")]
RouterEndpoint = Annotated[
    str | None,
    typer.Option("--connect", metavar="ENDPOINT", help="A router to connect to, instead of listening."),
]
JournalFolder = Annotated[
    Path,
    typer.Option("--state", metavar="DIR", help="Folder for what must outlast a restart; one per robot."),
]
OnRevision = Annotated[
    str,
    typer.Option(
        "--revision", metavar="next-stop|refuse", help="Handling of a revision pushed during a run."
    ),
]
LogSize = Annotated[
    float,
    typer.Option("--record", metavar="MB", min=1, help="Largest size of the telemetry log on its disk."),
]
ControllerKind = Annotated[
    str,
    typer.Option(
        "--controller",
        metavar="sim|mavlink:URL|ros2[-zenoh][:FILE]|MOD:FUNC",
        help="Base and scanner: simulated, an autopilot's, of ROS 2, or your own. ros2-zenoh needs no ROS.",
    ),
]
RosArguments = Annotated[
    str,
    typer.Option(
        "--ros-args",
        metavar="...",
        help="ros2: the rest of the line is for the ROS node, as -r __ns:=/r1.",
    ),
]
SimulatedPose = Annotated[
    str | None,
    typer.Option(
        "--at",
        metavar="X,Y,HEADING",
        rich_help_panel=SIMULATION,
        help="sim: initial pose in the site frame; default: the mission's start.",
    ),
]
SiteToMap = Annotated[
    str | None,
    typer.Option(
        "--map",
        metavar="X,Y,HEADING",
        rich_help_panel=SIMULATION,
        help="sim: site to map: rotate by HEADING, then shift.",
    ),
]
FaultsOfRobot = Annotated[
    list[str] | None,
    typer.Option(
        "--fault",
        metavar="KIND@N[=AMOUNT]",
        rich_help_panel=SIMULATION,
        help="sim: fault to simulate, as slip@2=0.2.",
    ),
]
SpeedUp = Annotated[
    float,
    typer.Option(
        "--speed-up",
        min=0.01,
        max=1000,
        rich_help_panel=SIMULATION,
        help="Simulation: its time runs faster by this factor.",
    ),
]
BatteryLife = Annotated[
    str,
    typer.Option(
        "--battery-life",
        metavar="DURATION",
        rich_help_panel=SIMULATION,
        help="sim: runtime per charge, such as 90min or 6h; 0: the battery does not run down.",
    ),
]
AutopilotId = Annotated[
    int | None,
    typer.Option(
        "--vehicle",
        metavar="ID",
        rich_help_panel=VEHICLE,
        help="mavlink: its system id, if there are several.",
    ),
]
ArmInRun = Annotated[
    bool, typer.Option("--arm", rich_help_panel=VEHICLE, help="mavlink: arm it when a run needs that.")
]
SetOriginOfAutopilot = Annotated[
    bool,
    typer.Option(
        "--set-origin",
        rich_help_panel=VEHICLE,
        help="mavlink: give it the mission's origin whenever it has none.",
    ),
]
SetTimeout = Annotated[
    bool,
    typer.Option(
        "--set-timeout",
        rich_help_panel=VEHICLE,
        help="mavlink: set the time that it drives on without this computer to 0.5 s.",
    ),
]
ScannerTrigger = Annotated[
    str,
    typer.Option(
        "--trigger",
        metavar="camera|script",
        rich_help_panel=VEHICLE,
        help="mavlink: what triggers the scanner.",
    ),
]

# A simulated vehicle

SimulatedUrl = Annotated[
    str,
    typer.Option("--mavlink", metavar="URL", help="Address to listen on, or of the station it connects to."),
]
SimulatedAutopilot = Annotated[
    str,
    typer.Option(
        "--autopilot", metavar="strict|ardupilot|px4", help="Autopilot whose protocol behaviour it has."
    ),
]
SimulatedState = Annotated[
    Path | None,
    typer.Option("--state", metavar="DIR", help="Folder for what must outlast a restart; one per vehicle."),
]
SimulatedOrigin = Annotated[
    str | None,
    typer.Option("--origin", metavar="LAT,LON,ALT[,HEADING]", help="Its global origin from the start."),
]
VehiclePose = Annotated[
    str | None, typer.Option("--at", metavar="X,Y,HEADING", help="Initial pose in the site frame.")
]
FaultsOfVehicle = Annotated[
    list[str] | None,
    typer.Option("--fault", metavar="KIND@N[=AMOUNT]", help="Fault to simulate, as nack@3."),
]
Exact = Annotated[
    bool, typer.Option("--exact", help="No position error at any stop; real vehicles always have some.")
]
Seed = Annotated[int, typer.Option("--seed", help="Seed of the random numbers.")]
ParameterValues = Annotated[
    list[str] | None,
    typer.Option("--param", metavar="NAME=VALUE", help="Set one of its parameters, as WP_RADIUS=0.1."),
]

# A MAVLink tunnel

TunnelledVehicle = Annotated[str, typer.Option("--mavlink", metavar="URL", help="Address of the vehicle.")]
GroundProgram = Annotated[
    str, typer.Option("--mavlink", metavar="URL", help="Address of the ground program.")
]
JoinedRobot = Annotated[
    str | None,
    typer.Option(
        "--connect", metavar="ENDPOINT", help="The robot's own endpoint to join, instead of listening."
    ),
]
RawOrders = Annotated[
    bool,
    typer.Option("--allow-commands", help="Allow all MAVLink messages, not only telemetry and stopping."),
]

# Conformance

MayDrive = Annotated[
    bool,
    typer.Option("--drive", help="Let the robot drive: half a metre ahead of its position, and back."),
]
RestartCommand = Annotated[
    str | None,
    typer.Option("--restart", metavar="COMMAND", help="Restarts the robot's program, and returns."),
]
SlowDiskCommand = Annotated[
    str | None,
    typer.Option(
        "--slow-disk",
        metavar="COMMAND",
        help="Makes each sync of the robot's disk take the given seconds (0: as before), and returns.",
    ),
]
StationCommand = Annotated[
    str | None,
    typer.Option(
        "--command",
        metavar="COMMAND",
        help="Makes the station act; {what} becomes `push FILE`, `start`, … Else stopgo asks you.",
    ),
]
ActionTime = Annotated[
    float,
    typer.Option(
        "--patience",
        metavar="S",
        min=1,
        max=1e6,
        help="Time that you have for each action, without --command.",
    ),
]

# Keys

SiteFolder = Annotated[Path, typer.Option("--in", metavar="DIR", help="The site's folder of keys.")]
AnySiteFolder = Annotated[Path | None, typer.Option("--in", metavar="DIR", help="The site's folder of keys.")]
SiteFolderArgument = Annotated[
    Path | None, typer.Argument(metavar="DIR", help="The site's folder of keys.", show_default=False)
]
NewFolder = Annotated[Path, typer.Argument(metavar="DIR", help="A new folder.")]
Days = Annotated[int, typer.Option("--days", min=1, max=825, help="Validity of the keys, in days.")]
Addresses = Annotated[
    list[str] | None,
    typer.Option(
        "--address",
        metavar="ADDRESS",
        help="IP address or name of a robot or router, besides this machine; repeatable.",
    ),
]
KeyRole = Annotated[str, typer.Argument(help="station, viewer, robot or router.")]
HolderName = Annotated[str, typer.Argument(help="Name of the holder; for a robot, its --name.")]
OnlyReplaced = Annotated[bool, typer.Option("--old", help="Only keys that were replaced.")]
