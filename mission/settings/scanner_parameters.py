"""Parameters of the scanner."""

from dataclasses import dataclass
from functools import partial
from typing import Annotated

from stopgo.mission.settings.parameter import Parameter
from stopgo.mission.settings.scanners import ScannerName

_scanner = partial(Parameter, "scanner", group="Scanner")


@dataclass(frozen=True, kw_only=True)
class ScannerParameters:
    """Table `scanner` of plan.toml."""

    scanner: Annotated[
        ScannerName | None,
        _scanner("Scanner by name; it gives the parameters that are not given", first=True, quiet=True),
    ] = None
    near: Annotated[
        float | None,
        _scanner("Minimum scanner range", "m", least=0, undecided="0", quiet=True, word="min_range"),
    ] = None
    angular_step: Annotated[
        float | None, _scanner("Angle between neighbouring points", "degrees", above=0, most=5, quiet=True)
    ] = None
    blind_cone: Annotated[
        float | None,
        _scanner(
            "Apex angle of the blind cone under the scanner",
            "degrees",
            least=0,
            most=170,
            undecided="0",
            quiet=True,
        ),
    ] = None
    range_noise: Annotated[
        float | None,
        _scanner(
            "Noise of a distance that the scanner measures, rms",
            "mm",
            above=0,
            most=15,
            undecided="2",
            quiet=True,
        ),
    ] = None
    scanner_height: Annotated[
        float | None,
        _scanner(
            "Height of the scanner above the floor",
            "m",
            above=0,
            below=10,
            undecided="cut_height, else 1.3",
            quiet=True,
        ),
    ] = None
    range: Annotated[float, _scanner("Maximum scanner range", "m", first=True, above=0)] = 5.0
    fov: Annotated[
        float, _scanner("Horizontal field of view of the scanner", "degrees", least=10, most=360)
    ] = 360.0
    profile: Annotated[str, _scanner("Name of the scan profile on the scanner")] = "default"
    settle: Annotated[float, _scanner("Settle time before a scan", "s", least=0)] = 2.0
    scan_time: Annotated[float, _scanner("Duration of a scan", "s", least=0)] = 60.0
