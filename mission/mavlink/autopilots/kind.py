"""What there is to know of a kind of autopilot: what it keeps of items, its modes, its habits."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal, Protocol

from stopgo.mission.mavlink.enums import CommandResult, MissionResult, ModeFlag, SystemState, VehicleType
from stopgo.mission.mavlink.items import Item

ROVERS = (VehicleType.GROUND_ROVER, VehicleType.SURFACE_BOAT)
EVERYWHERE = frozenset({16, 17, 19, 20, 21, 22, 93, 112, 178, 203, 2000, 2001})
"""Commands of a mission that every kind takes; take-off, landing and conditions are skipped."""
ModeName = Literal["manual", "hold", "auto", "guided"]
AUTO, HOLD = "AUTO", "HOLD"
"""What every kind's modes are called in which it follows its mission, and stands."""


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
    """How a kind of autopilot numbers and names its modes."""

    numbers: Mapping[ModeName, Mode]
    flags: Mapping[ModeName, int]
    """The `base_mode` of a heartbeat in each."""
    names: Mapping[Mode, str]
    """What people call each; one with a sub-mode is called by its main mode where it has no name."""
    packed: bool
    """A heartbeat has main and sub mode in the two upper bytes of `custom_mode`."""

    @property
    def auto(self) -> Mode:
        """It follows its mission."""
        return self.numbers["auto"]

    @property
    def hold(self) -> Mode:
        """It stands."""
        return self.numbers["hold"]

    @property
    def guided(self) -> Mode:
        """It goes where it is told from outside."""
        return self.numbers["guided"]

    def of(self, custom_mode: int) -> Mode:
        """The mode in a heartbeat."""
        return Mode(custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF) if self.packed else Mode(custom_mode)

    def custom(self, mode: Mode) -> int:
        """The inverse of `of`."""
        return mode.sub << 24 | mode.main << 16 if self.packed else mode.main

    def name(self, mode: Mode) -> str:
        """What people call a mode."""
        main = self.names.get(Mode(mode.main), f"mode {mode.main}")
        return self.names.get(mode, f"{main} {mode.sub}" if mode.sub else main)


@dataclass(frozen=True)
class Driving:
    """How it is driven from outside, in its mode `guided`."""

    streams: bool
    """It leaves that mode unless setpoints keep coming, so it is put on hold wherever it arrives."""
    gives_up_s: float
    """How long it drives on by a velocity that is not told again, where it does not tell."""
    gives_up_parameter: str
    """Its parameter that says so."""
    turns: bool
    """It turns to a yaw that is told without a place."""
    courses: Literal["heading", "vector"]
    """What a velocity without a place means: with a yaw, a speed along that yaw, backwards if its first
    number is negative; or, whatever the yaw, a way to drive, to which it turns on the spot first."""
    reposition_mode: ModeName
    """The mode in which it drives DO_REPOSITION."""


@dataclass(frozen=True)
class ProtocolBehaviour:
    """What it does where the protocols leave a choice, as a simulated vehicle must do it too."""

    asks_int: bool
    """Asks for items with MISSION_REQUEST_INT; else with MISSION_REQUEST."""
    ask_again_s: float
    give_up_s: float
    tells_giving_up: bool
    atomic: bool
    """A mission is replaced when its last item has come; else item by item."""
    strays: Literal["tell", "ignore", "ask"]
    """An item that was not asked for is answered with INVALID_SEQUENCE, not at all, or by asking again."""
    last_again: MissionResult
    """Answer to the last item when it comes again after its ACK."""
    forgives_late: bool
    """Other items that come again then are not answered."""
    other_station: MissionResult
    """Answer to a second station that announces an upload."""
    busy_in_words: bool
    """Other messages during a transfer are answered with a text for people."""
    begins_again: bool
    """A station may announce a new upload in the middle of its own."""
    cancels: bool
    """An ACK with OPERATION_CANCELLED ends an upload."""
    clears_in_auto: bool
    counts_again: bool
    """To a request for an item that it has not it also tells how many it has."""
    restarts_item: bool
    """An upload in AUTO restarts the current item; else the mission begins anew."""
    same_is_nothing: bool
    """The list that it holds already changes nothing."""
    checks_frame_first: bool
    """Looks at an item's frame before its command, and hardly at its numbers."""
    highest_m: float
    """Places so high or so low are refused."""
    takes: frozenset[int]
    """Commands that a mission may hold; some of them it may skip."""
    done_mode: ModeName
    """The mode once a mission is finished."""
    pauses: bool
    """Tells a mission that is paused from one that was not started."""
    origin_again: bool
    """The global origin can be set again before a reboot."""
    says_no: CommandResult
    """To a command that it could obey at other times."""
    modes_by_flags: bool
    """SET_MODE and DO_SET_MODE may name a mode by flags alone."""
    acknowledges_set_mode: bool
    jumps_by_command: bool
    """DO_SET_MISSION_CURRENT is obeyed; else only MISSION_SET_CURRENT."""
    start_takes_item: bool
    """MISSION_START may name the first item."""
    start_arms: bool
    pauses_by_command: bool
    """DO_PAUSE_CONTINUE is obeyed."""
    speed_while_driving: bool
    """DO_CHANGE_SPEED is taken only on the way somewhere."""
    speed_parameter: str
    system_parameter: str


@dataclass(frozen=True)
class ParameterRule:
    """A parameter on which a mission of scan stops depends."""

    names: tuple[str, ...]
    """What releases call it; the first that the vehicle has counts."""
    right: Callable[[float], bool]
    set_to: str
    """The value to set, in words."""
    why: str
    when: Literal["always", "indoors"] = "always"
    """Indoors the vehicle finds its place by somebody else's localisation, not by satellites."""
    must: bool = True
    """Whether a mission fails without it; else it is worth knowing."""
    before: ParameterRule | None = None
    """What older releases had in its stead, with another meaning."""


@dataclass(frozen=True)
class Steering:
    """How a rover tells by its parameters in what way it turns."""

    parameters: tuple[str, ...]
    like_a_car: Callable[[Mapping[str, float]], str]
    """The parameter that says that it steers its wheels, with its value; empty if none does."""


def turns_anyhow(values: Mapping[str, float]) -> str:
    """Of a kind of which nothing is known."""
    return ""


@dataclass(frozen=True)
class Autopilot:
    """A kind of autopilot."""

    name: str
    firmware: int
    """MAV_AUTOPILOT."""
    rule: str
    """How it turns degrees into metres, one of `stopgo.mission.frames.geodesy.RULES`."""

    # Items

    frame: int
    """MAV_FRAME in which places are sent; altitude 0 is the robot's floor."""
    max_items: int
    """How many items it holds, home included where item 0 is home."""
    home_first: bool
    """Item 0 is home, which the vehicle overwrites with its own."""
    commands: frozenset[int]
    """The commands that a mission of scan stops may use on it."""
    keep: Callable[[Item], Item]
    brake_hold_s: int
    """Hold (whole seconds) without which it does not stop at a waypoint."""
    longest_hold_s: float
    """A longer hold is taken for none."""
    max_delay_s: float
    keeps_arrival: bool
    """Keeps a waypoint's acceptance radius and heading."""
    radius_parameter: str
    """Within which a waypoint counts as reached; empty if it has no parameter of that kind."""
    reached: str
    """Where it counts a waypoint as reached, in words."""
    turns: bool
    """A rover turns to a heading that it keeps."""
    gives_items: Literal["any order", "in order", "either"]
    """How its items may be asked for; `either` where that is to be found out."""

    # Modes, and orders from outside

    modes: Modes
    in_auto: Callable[[Heartbeat], bool]
    """Whether a heartbeat shows the mode in which it follows its mission."""
    driving: Driving
    drivable: bool
    """A robot of ours may drive it: `driving` was measured, or read in its source."""
    habits: ProtocolBehaviour
    parameters: tuple[ParameterRule, ...] = ()
    """What its parameters must be for a mission."""
    steering: Steering = Steering((), turns_anyhow)
    whole_bytewise: bool = False
    """A whole number's four bytes stand in PARAM_VALUE as they are; else it is told as a float."""

    def why_no_pivot(self, values: Mapping[str, float]) -> str:
        """Why it cannot turn on the spot, by its `steering.parameters`; empty if it can, or does not tell."""
        told = self.steering.like_a_car(values)
        return f"it steers like a car ({told}) and cannot turn on the spot" if told else ""

    def kept(self, item: Item) -> Item:
        """The item as the vehicle will read it back."""
        return self.keep(item)

    def sequence(self, index: int) -> int:
        """Sequence number on the vehicle of the item at `index` of an `ItemList`."""
        return index + 1 if self.home_first else index

    def index(self, sequence: int) -> int:
        """Place in an `ItemList` of a sequence number on the vehicle; home is -1."""
        return sequence - 1 if self.home_first else sequence

    def mode_of(self, heartbeat: Heartbeat) -> Mode:
        return self.modes.of(heartbeat.custom_mode)

    def in_failsafe(self, heartbeat: Heartbeat) -> bool:
        """Whether it does what a failsafe of its own wants, and not what somebody ordered."""
        return heartbeat.system_status == SystemState.CRITICAL

    def mode_name(self, heartbeat: Heartbeat) -> str:
        """AUTO, HOLD, or what the vehicle's people call the mode it is in."""
        if self.in_auto(heartbeat):
            return AUTO
        mode = self.mode_of(heartbeat)
        return HOLD if mode == self.modes.hold else self.modes.name(mode)


def why_no_rover(vehicle_type: int) -> str:
    """Why a vehicle of this MAV_TYPE is not driven from here; empty if it is."""
    return "" if vehicle_type in ROVERS else f"vehicle type {vehicle_type} is no rover (10) or boat (11)"
