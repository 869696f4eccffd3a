"""Properties of a kind of autopilot: the item fields it keeps, its modes, its protocol behaviour."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal, Protocol

from stopgo.mission.mavlink.enums import CommandResult, MissionResult, ModeFlag, SystemState, VehicleType
from stopgo.mission.mavlink.items import Item

ROVERS = (VehicleType.GROUND_ROVER, VehicleType.SURFACE_BOAT)
EVERYWHERE = frozenset({16, 17, 19, 20, 21, 22, 93, 112, 178, 203, 2000, 2001})
"""Mission commands that every kind accepts; take-off, landing and conditions are skipped."""
ModeName = Literal["manual", "hold", "auto", "guided"]
AUTO, HOLD = "AUTO", "HOLD"
"""Common names of every kind's modes for following its mission, and for standstill."""


class Heartbeat(Protocol):
    """The fields of HEARTBEAT that are read."""

    type: int
    autopilot: int
    base_mode: int
    custom_mode: int
    system_status: int


@dataclass(frozen=True)
class Mode:
    """A mode as DO_SET_MODE names it."""

    main: int
    sub: int = 0

    @property
    def params(self) -> tuple[float, float, float]:
        return (float(ModeFlag.CUSTOM_MODE_ENABLED), float(self.main), float(self.sub))


@dataclass(frozen=True)
class Modes:
    """Numbers and names of an autopilot's modes."""

    numbers: Mapping[ModeName, Mode]
    flags: Mapping[ModeName, int]
    """The `base_mode` of a heartbeat in each."""
    names: Mapping[Mode, str]
    """Name of each mode; a sub-mode without a name has that of its main mode."""
    packed: bool
    """A heartbeat has main and sub mode in the two upper bytes of `custom_mode`."""

    @property
    def auto(self) -> Mode:
        """The mode in which it follows its mission."""
        return self.numbers["auto"]

    @property
    def hold(self) -> Mode:
        """The mode in which it is stationary."""
        return self.numbers["hold"]

    @property
    def guided(self) -> Mode:
        """The mode in which it follows setpoints from outside."""
        return self.numbers["guided"]

    def of(self, custom_mode: int) -> Mode:
        """Return the mode in a heartbeat."""
        return Mode(custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF) if self.packed else Mode(custom_mode)

    def custom(self, mode: Mode) -> int:
        """Return the `custom_mode` of a mode: the inverse of `of`."""
        return mode.sub << 24 | mode.main << 16 if self.packed else mode.main

    def name(self, mode: Mode) -> str:
        """Return the name of a mode."""
        main = self.names.get(Mode(mode.main), f"mode {mode.main}")
        return self.names.get(mode, f"{main} {mode.sub}" if mode.sub else main)


ALONE_S = 0.5
"""Longest time that a vehicle should drive on without the computer that steers it."""


@dataclass(frozen=True)
class Driving:
    """Control of a vehicle from outside, in its mode `guided`."""

    streams: bool
    """It leaves that mode without a stream of setpoints, so it is put on hold wherever it arrives."""
    gives_up_s: float
    """Time that it drives on with a velocity that is not repeated, if no parameter contains it."""
    gives_up_parameter: str
    """Name of the parameter that contains this time."""
    turns: bool
    """It turns to a yaw without a position."""
    courses: Literal["heading", "vector"]
    """Meaning of a velocity without a position. `heading`: with a yaw, a speed along that yaw, backwards if
    its first number is negative. `vector`: whatever the yaw, a direction; it turns there first."""
    reposition_mode: ModeName
    """The mode in which it drives DO_REPOSITION."""


@dataclass(frozen=True)
class ProtocolBehaviour:
    """Behaviour where the protocols leave a choice; a simulated vehicle behaves the same."""

    asks_int: bool
    """Asks for items with MISSION_REQUEST_INT; else with MISSION_REQUEST."""
    ask_again_s: float
    give_up_s: float
    tells_giving_up: bool
    atomic: bool
    """A mission is replaced when its last item has come; else item by item."""
    strays: Literal["tell", "ignore", "ask"]
    """Answer to an item that was not requested: INVALID_SEQUENCE, none, or a repeated request."""
    last_again: MissionResult
    """Answer to a repetition of the last item after its ACK."""
    forgives_late: bool
    """Other items repeated then are not answered."""
    other_station: MissionResult
    """Answer to a second station that announces an upload."""
    busy_in_words: bool
    """Other messages during a transfer are answered with a text."""
    begins_again: bool
    """A station may announce a new upload in the middle of its own."""
    cancels: bool
    """An ACK with OPERATION_CANCELLED ends an upload."""
    clears_in_auto: bool
    counts_again: bool
    """A request for an item that does not exist is also answered with the number of items."""
    restarts_item: bool
    """An upload in AUTO restarts the current item; else it restarts the mission."""
    same_is_nothing: bool
    """A list equal to the present one changes nothing."""
    checks_frame_first: bool
    """Checks an item's frame before its command, and hardly its numbers."""
    highest_m: float
    """Positions above or below this altitude are refused."""
    takes: frozenset[int]
    """Commands that a mission may hold; some of them it may skip."""
    done_mode: ModeName
    """The mode after a mission is finished."""
    pauses: bool
    """Distinguishes a paused mission from one that was not started."""
    origin_again: bool
    """The global origin can be set again before a reboot."""
    says_no: CommandResult
    """Answer to a command that it could execute at other times."""
    modes_by_flags: bool
    """SET_MODE and DO_SET_MODE may name a mode by flags alone."""
    acknowledges_set_mode: bool
    mission_ids: bool
    """MISSION_CURRENT has an id of the list, which changes with it."""
    jumps_by_command: bool
    """DO_SET_MISSION_CURRENT is executed; else only MISSION_SET_CURRENT."""
    start_takes_item: bool
    """MISSION_START may name the first item."""
    start_arms: bool
    pauses_by_command: bool
    """DO_PAUSE_CONTINUE is executed."""
    speed_while_driving: bool
    """DO_CHANGE_SPEED is accepted only while it drives."""
    speed_parameter: str
    system_parameter: str


@dataclass(frozen=True)
class ParameterRule:
    """A parameter on which a mission of scan stops depends."""

    names: tuple[str, ...]
    """Names in different releases; the first that the vehicle has counts."""
    right: Callable[[float], bool]
    set_to: str
    """The value to set, in words."""
    why: str
    when: Literal["always", "indoors"] = "always"
    """`indoors`: the vehicle is located by a third-party localisation, not by satellites."""
    must: bool = True
    """True if a mission fails without it; else it is only worth knowing."""
    before: ParameterRule | None = None
    """Parameter of older releases in its place, with another meaning."""


@dataclass(frozen=True)
class Steering:
    """Parameters that show a rover's type of steering."""

    parameters: tuple[str, ...]
    car_steering: Callable[[Mapping[str, float]], str]
    """Returns the parameter that shows car-like steering, with its value; empty if none does."""


def unknown_steering(values: Mapping[str, float]) -> str:
    """Return an empty text: nothing is known of this kind's steering."""
    return ""


@dataclass(frozen=True)
class Autopilot:
    """A kind of autopilot."""

    name: str
    firmware: int
    """MAV_AUTOPILOT."""
    rule: str
    """Its conversion of degrees to metres, one of `stopgo.mission.frames.geodesy.RULES`."""

    # Items

    frame: int
    """MAV_FRAME of sent positions; altitude 0 is the robot's floor."""
    max_items: int
    """Greatest number of items, with home if item 0 is home."""
    home_first: bool
    """Item 0 is home, which the vehicle overwrites with its own."""
    commands: frozenset[int]
    """The commands that a mission of scan stops may use on it."""
    keep: Callable[[Item], Item]
    brake_hold_s: int
    """Hold (whole seconds) without which it does not stop at a waypoint."""
    longest_hold_s: float
    """A longer hold counts as none."""
    max_delay_s: float
    keeps_arrival: bool
    """Keeps a waypoint's acceptance radius and heading."""
    radius_parameter: str
    """Name of the parameter within which a waypoint counts as reached; empty if there is none."""
    reached: str
    """Condition for a reached waypoint, in words."""
    turns: bool
    """A rover turns to a heading that it keeps."""
    gives_items: Literal["any order", "in order", "either"]
    """Order in which its items may be requested; `either` if that is not known yet."""

    # Modes, and orders from outside

    modes: Modes
    in_auto: Callable[[Heartbeat], bool]
    """Returns True if a heartbeat shows the mode in which it follows its mission."""
    driving: Driving
    drivable: bool
    """A stopgo robot may drive it: `driving` was measured, or read in its source."""
    behaviour: ProtocolBehaviour
    parameters: tuple[ParameterRule, ...] = ()
    """Parameters on which a mission depends."""
    steering: Steering = Steering((), unknown_steering)
    whole_bytewise: bool = False
    """A whole number's four bytes are in PARAM_VALUE unchanged; else it is sent as a float."""
    failsafe_texts: tuple[str, ...] = (
        "Battery 1 is low 10.50V used 1200 mAh", "Radio Failsafe", "GCS Failsafe", "Polygon fence breached",
        "Crash: Going to HOLD", "EKF failsafe",
    )  # fmt: skip
    """Texts of its failsafes: battery, remote control, ground station, geofence, crash, position estimate."""

    def why_no_pivot(self, values: Mapping[str, float]) -> str:
        """Return why it cannot turn on the spot, by its steering parameters; empty if it can."""
        parameter = self.steering.car_steering(values)
        return f"it steers like a car ({parameter}) and cannot turn on the spot" if parameter else ""

    def kept(self, item: Item) -> Item:
        """Return the item as the vehicle will read it back."""
        return self.keep(item)

    def sequence(self, index: int) -> int:
        """Return the sequence number on the vehicle of the item at `index` of an `ItemList`."""
        return index + 1 if self.home_first else index

    def index(self, sequence: int) -> int:
        """Return the index in an `ItemList` of a sequence number on the vehicle; home is -1."""
        return sequence - 1 if self.home_first else sequence

    def mode_of(self, heartbeat: Heartbeat) -> Mode:
        return self.modes.of(heartbeat.custom_mode)

    def in_failsafe(self, heartbeat: Heartbeat) -> bool:
        """Return True if a failsafe of the vehicle is in control."""
        return heartbeat.system_status == SystemState.CRITICAL

    def mode_name(self, heartbeat: Heartbeat) -> str:
        """Return AUTO, HOLD, or the vehicle's own name of its mode."""
        if self.in_auto(heartbeat):
            return AUTO
        mode = self.mode_of(heartbeat)
        return HOLD if mode == self.modes.hold else self.modes.name(mode)


def why_no_rover(vehicle_type: int) -> str:
    """Return why a vehicle of this MAV_TYPE cannot be driven; empty if it can."""
    return "" if vehicle_type in ROVERS else f"vehicle type {vehicle_type}: neither rover (10) nor boat (11)"
