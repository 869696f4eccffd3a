"""Parts of the page in reading order: verdict, numbers, picture, tables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from stopgo.mission.comparing.acquired import Acquired
from stopgo.mission.comparing.acquiring import name_of
from stopgo.mission.comparing.comparison import Comparison, StopComparison
from stopgo.mission.console.table import duration
from stopgo.mission.document.schedule import schedule
from stopgo.mission.files.mission_text import route_length
from stopgo.mission.files.stop_list import stop_list
from stopgo.mission.run.events import Scanned
from stopgo.mission.stages.figures import CoveragePair, GroupCoverage, percent
from stopgo.recordings.page.floor_picture import errors_in_picture, legend, line_sample, plan_picture
from stopgo.recordings.page.plots import plots
from stopgo.recordings.page.runs_together import newest_of, number_of, run_names, when_and_who
from stopgo.recordings.page.stop_table import stop_table
from stopgo.recordings.page.style import ANSWERS, BLUE, ERROR, GREY, PURPLE, STATES, VERMILION, YELLOW
from stopgo.recordings.page.subject import ReportSubject
from stopgo.recordings.page.words import grid, number, row, section, shown, tag, tile

MOST_ELEMENTS = 40
"""Limit of listed elements; those with the least coverage come first."""


def body(subject: ReportSubject) -> str:
    """Return everything between <body> and </body>."""
    runs = subject.comparisons
    parts = [_title(subject), *_problems(subject)]
    if not runs:
        parts += [_plan_band(subject), _plan_tiles(subject), _pictured(subject, None), _plan_tables(subject)]
        parts += [stop_table(subject.reasons)]
    if len(runs) > 1 or subject.together:
        parts += [_runs_compared(subject)]
    parts += [
        tag("div", *_run(subject, comparison, alone=len(runs) == 1), class_="run") for comparison in runs
    ]
    return "\n".join([*parts, _findings(subject), _alignments(subject), _sources(subject)])


def _title(subject: ReportSubject) -> str:
    newest = newest_of(subject.missions)
    missions = "; ".join(f"mission {mission.id[:12]}, revision {mission.revision}" for mission in newest)
    about = f"{missions}, floor {subject.mission.origin.floor}"
    return tag("h1", shown(subject.name), " ", tag("small", shown(about)))


def _problems(subject: ReportSubject) -> Iterator[str]:
    if subject.problems:
        lines = "".join(tag("li", shown(problem)) for problem in subject.problems)
        yield tag("div", tag("b", "These files have problems; check them."), tag("ul", lines), class_="band",
                  style=f"background:{ANSWERS['no']}")  # fmt: skip


# ---- a plan alone ----


def _plan_band(subject: ReportSubject) -> str:
    planned = None if subject.sight is None else subject.sight.planned
    if planned is None:
        return tag("div", tag("b", "Planned."), class_="band", style=f"background:{ANSWERS['unknown']}")
    whole = planned.whole
    required = "" if whole.required is None else f"; {percent(whole.required)} is required"
    met = not planned.short
    text = f" {percent(whole.coverage)} of what is visible will be scanned{required}."
    headline = tag("b", "Planned." if met else "Planned, but below the requirement.")
    return tag("div", headline, shown(text), class_="band",
               style=f"background:{ANSWERS['yes' if met else 'no']}")  # fmt: skip


def _plan_tiles(subject: ReportSubject) -> str:
    mission, times = subject.mission, schedule(subject.mission)
    group = None if subject.sight is None else subject.sight.planned.whole
    visible = "" if group is None else f"{percent(group.visible_fraction)} of all is visible"
    tiles = [
        tile("stops", str(len(mission.stops)), subject.results.bound_text),
        tile("coverage", percent(None if group is None else group.coverage), visible),
        tile("route", f"{route_length(mission):.1f} m", "back to the start" if mission.return_ else "open"),
        tile("run time", duration(times.total_s), _least_time(subject, times.scan_s)),
    ]
    return tag("div", *tiles, class_="tiles")


def _least_time(subject: ReportSubject, scan_s: float) -> str:
    """Return a note: scanning time, and for a plan of least time its lower bound."""
    bound, before = subject.results.least_time_bound_s, subject.results.two_step_s
    if bound is None or before is None:
        return f"of which scanning {duration(scan_s)}"
    return (
        f"scanning {duration(scan_s)}; at least {duration(bound)}; {duration(before)} by fewest stops first"
    )


def _plan_tables(subject: ReportSubject) -> str:
    columns = ("stop", "x m", "y m", "arrives", "units", "new")
    rows = [row(shown(stop.cells[name]) for name in columns) for stop in stop_list(subject.mission)]
    stops = section("Stops", grid(columns, rows))
    if subject.sight is None:
        return stops
    planned = subject.sight.planned
    tables = [
        section("Rooms, worst first", _plan_coverage(planned.rooms, "room")),
        section("Kinds", _plan_coverage(planned.kinds, "kind")),
    ]
    return tag("div", stops, tag("div", *tables), class_="columns")


def _plan_coverage(groups: Sequence[GroupCoverage], what: str) -> str:
    return _coverage_grid([(group, group) for group in groups], what, alone=True)


# ---- a run ----


def _run(subject: ReportSubject, comparison: Comparison, *, alone: bool) -> Iterator[str]:
    if not alone:
        yield tag("h2", shown(f"Run of {_name_of(subject, comparison)}"))
    identity = f", run {comparison.run_id}" if comparison.run_id else ""
    yield tag("p", shown(when_and_who(comparison) + ("" if alone else identity)))
    judgement = subject.judgement(comparison)
    words = shown(" " + " ".join(judgement.sentences))
    yield tag("div", tag("b", shown(f"{judgement.headline}.")), words, class_="band",
              style=f"background:{ANSWERS[judgement.answer]}")  # fmt: skip
    yield tag("div", *_tiles(comparison), class_="tiles")
    yield _states(comparison)
    yield _pictured(subject, comparison)
    yield section("Stops", tag("div", _stop_grid(comparison), class_="scroll"))
    if comparison.acquired is not None:
        yield tag("div", *_coverage_tables(comparison.acquired), class_="columns")
    yield section("Health of the vehicle", _health(comparison))
    gaps = [tag("li", shown(line)) for line in comparison.sighted.lines]
    yield section("Gaps in the poses", tag("ul", *gaps) if gaps else "")
    for title, lines in subject.more.get(comparison.run_id, ()):
        yield section(title, tag("ul", *(tag("li", shown(line)) for line in lines)))
    yield section("During the run", plots(comparison))


def _name_of(subject: ReportSubject, comparison: Comparison) -> str:
    """Return date and robot of a run, as among all runs of the page."""
    runs = subject.comparisons
    return next(name for run, name in zip(runs, run_names(runs), strict=True) if run is comparison)


def _tiles(comparison: Comparison) -> Iterator[str]:
    deviation_m = comparison.greatest_deviation_m
    driven = "not ended" if comparison.driven_s is None else duration(comparison.driven_s)
    tolerance = max((stop.tolerance_m for stop in comparison.mission.stops), default=0.0)
    paused, held = (sum(span.state == state for span in comparison.spans) for state in ("PAUSED", "HELD"))
    yield tile(
        "stops scanned", f"{comparison.scanned} / {len(comparison.asked)}", f"robot {comparison.log.robot}"
    )
    if comparison.acquired is not None:
        groups, planned = comparison.acquired.coverage, comparison.acquired.planned
        asked = "" if groups.whole.required is None else f"required {percent(groups.whole.required)}, "
        planned_text = f"{asked}planned {percent(planned.whole.coverage)}"
        yield tile("coverage acquired", percent(groups.whole.coverage), planned_text)
    yield tile("run time", driven, f"planned {duration(comparison.planned_s)}")
    limit = f"tolerance {1000 * tolerance:.0f} mm"
    yield tile("greatest position error at a stop", _millimetres(deviation_m), limit)
    poses = comparison.log.poses
    driven_m = f"{poses.length_m:.1f} m driven" if len(poses) else "the path is not in the log"
    limits = comparison.sighted.limits
    note = f"{driven_m} {limits}" if limits else driven_m
    yield tile("greatest cross-track error", _path_error(comparison), note)
    stationary_s = comparison.seconds_in("PAUSED", "HELD")
    yield tile("stationary", duration(stationary_s), f"paused {paused}, held {held}")


def _path_error(comparison: Comparison) -> str:
    """Return the greatest cross-track error; of a path with gaps, it is that of the seen part."""
    greatest = _millimetres(comparison.cross_track.greatest_m)
    return f"≤ {greatest}" if comparison.sighted.gaps else greatest


def _millimetres(metres: float | None) -> str:
    return "–" if metres is None else f"{1000 * metres:.1f} mm"


def _states(comparison: Comparison) -> str:
    whole = sum(span.seconds for span in comparison.spans)
    if not whole:
        return ""
    parts = []
    for span in comparison.spans:
        back, ink = STATES.get(span.state, (GREY, "#fff"))
        title = f"{span.state} from {duration(span.begin_s)} to {duration(span.end_s)} {span.why}"
        look = f"width:{100 * span.seconds / whole:.3f}%;background:{back};color:{ink}"
        parts.append(tag("div", span.state, style=look, title=title))
    return tag("div", *parts, class_="states")


def _pictured(subject: ReportSubject, comparison: Comparison | None) -> str:
    seen = "planned" if comparison is None else "scanned"
    marks = [(line_sample(BLUE, 2.4), seen), (line_sample(GREY, 1.2, "4 3"), "never planned")]
    if comparison is not None:
        marks.insert(1, (line_sample(VERMILION, 5), "planned, not scanned (thick)"))
    marks.append((line_sample("#444", 1.1, "6 4"), "planned path"))
    if comparison is not None:
        diamond = tag("path", d="M13 1L18 6L13 11L8 6Z", fill=YELLOW, stroke="#111")
        cross = tag("path", d="M8 1H18V11H8ZM10 3L16 9M10 9L16 3", fill=VERMILION, stroke="#111")
        marks += [(line_sample(PURPLE, 2), "driven path")]
        if comparison.sighted.gaps:
            marks.append((line_sample(PURPLE, 1.8, "3 4"), "no poses: path unseen"))
        marks += [(cross, "not scanned"), (diamond, "stationary")]
    mission = subject.mission if comparison is None else comparison.mission
    if (errors := errors_in_picture(mission)) is not None:
        marks.append((line_sample(ERROR, 1.4), f"predicted scan error × {errors.factor:g}"))
    return legend(marks) + plan_picture(subject, comparison)


DRIVEN = ("late s", "along mm", "across mm", "heading °", "settle s", "tries", "lost %")


def _stop_grid(comparison: Comparison) -> str:
    missing = {item.stop for item in (*comparison.missing, *comparison.outside)}
    rows = [
        row(_stop_cells(item), **({"class_": "missing"} if item.stop in missing else {}))
        for item in comparison.stops
    ]
    return grid(("stop", "outcome", "planned", "arrived", *DRIVEN), rows)


def _stop_cells(item: StopComparison) -> list[str]:
    words = (item.outside_text or item.outcome, item.disputed_text, item.reason)
    outcome = ": ".join(word for word in words if word)
    driven = (item.cells[name] for name in DRIVEN)
    return [shown(item.stop), shown(outcome), _clock(item.planned_s), _clock(item.arrived_s), *driven]


def _clock(seconds: float | None) -> str:
    return "" if seconds is None else duration(seconds)


UNRECORDED = "battery, position estimate and geofence: unknown; this log holds none of them"


def _health(comparison: Comparison) -> str:
    """Return the health at the run's begin, at each change and at its end; what is not known is unknown."""
    log = comparison.log
    if not log.health:
        return tag("p", UNRECORDED)
    seconds = log.seconds([words.robot_ns for words in log.health]).tolist()
    rows = [
        row([_clock(at), shown(words.battery), shown(words.position), shown(words.fence)])
        for at, words in zip(seconds, log.health, strict=True)
    ]
    return grid(("run time", "battery", "position estimate", "geofence"), rows)


def _coverage_tables(acquired: Acquired) -> Iterator[str]:
    yield section("Rooms, worst first", _coverage_grid(acquired.rooms, "room"))
    yield section("Kinds", _coverage_grid(acquired.kinds, "kind"))
    totals = acquired.sight.totals
    planned = {item.name: item for item in totals.by_element(acquired.planned_seen)}
    pairs = [(planned[item.name], item) for item in acquired.elements if item.visible]
    worst = sorted(pairs, key=lambda pair: (pair[1].seen - pair[0].seen, pair[1].name))
    short = [pair for pair in worst if pair[1].seen < pair[0].seen]
    if short:
        title = f"Elements that lost most ({min(len(short), MOST_ELEMENTS)} of {len(short)})"
        yield section(title, _coverage_grid(short[:MOST_ELEMENTS], "element"))


def _coverage_grid(pairs: Sequence[CoveragePair], what: str, *, alone: bool = False) -> str:
    """Return rows of planned and acquired coverage; `alone` if there is only a plan."""
    rows = [row(_coverage_cells(planned, group, alone=alone)) for planned, group in pairs]
    header = (what, "planned", "") if alone else (what, "planned", "acquired", "")
    return grid(header, rows) if rows else ""


def _coverage_cells(planned: GroupCoverage, group: GroupCoverage, *, alone: bool) -> list[str]:
    name = shown(group.name) + (tag("small", shown(f" {group.why}")) if group.why else "")
    got = [] if alone else [tag("b", percent(group.coverage)) + ("" if group.met else " !")]
    return [name, percent(planned.coverage), *got, _bar(group)]


def _bar(group: GroupCoverage) -> str:
    """Return a bar of the coverage, with a mark at the required coverage."""
    if group.coverage is None:
        return ""
    colour = BLUE if group.met else VERMILION
    required = "" if group.required is None else tag("i", style=f"left:{100 * group.required:.1f}%")
    inner = tag("div", style=f"width:{100 * group.coverage:.1f}%;background:{colour}")
    return tag("div", inner, required, class_="bar")


# ---- several runs ----


def _runs_compared(subject: ReportSubject) -> str:
    runs = subject.comparisons
    header = ["", *map(shown, run_names(runs))]
    verdicts = (shown(subject.judgement(run).headline) for run in runs)
    rows = [row([tag("b", "verdict"), *verdicts])]
    rows += [row([tag("b", name), *(figure(run) for run in runs)]) for name, figure in _ROWS]
    by_stop = [{name_of(run.mission, item.stop): item for item in run.stops} for run in runs]
    numbered = sorted(zip(runs, by_stop, strict=True), key=lambda pair: number_of(pair[0].mission))
    stops = dict.fromkeys(stop for _, items in numbered for stop in items)
    cells = [row([shown(stop), *(_outcome(items.get(stop)) for items in by_stop)]) for stop in stops]
    lines = [tag("li", shown(line)) for line in subject.together]
    return (
        section("All runs together", tag("ul", *lines) if lines else "")
        + section("Runs", tag("div", grid(header, rows), class_="scroll"))
        + section("Stops of every run", tag("div", grid(header, cells), class_="scroll"))
        + section(
            "Rooms of every run", tag("div", _rooms_of(runs, header, subject.rooms_together), class_="scroll")
        )
    )


def _outcome(item: StopComparison | None) -> str:
    if item is None:
        return ""
    late = "" if item.late_s is None else f", {number(item.late_s, sign=True)} s"
    away = "" if item.deviation_m is None else f", {number(item.deviation_m, 1000)} mm"
    return shown(item.outcome) + late + away


def _rooms_of(runs: Sequence[Comparison], header: list[str], both: Sequence[CoveragePair]) -> str:
    """Return rooms in the plan's order, last of all runs together; unknown coverage is an empty cell."""
    known = [run.acquired for run in runs]
    first = next((item for item in known if item is not None), None)
    if first is None:
        return ""
    names = [group.name for group in first.sight.totals.rooms_seen(first.seen)]
    columns = [[] if item is None else item.sight.totals.rooms_seen(item.seen) for item in known]
    union = {group.name: percent(group.coverage) for _, group in both}
    return grid([*header, *(["together"] if union else [])], [
        row([
            shown(name),
            *(percent(column[k].coverage) if k < len(column) else "" for column in columns),
            *([tag("b", union.get(name, ""))] if union else []),
        ])
        for k, name in enumerate(names)
    ])  # fmt: skip


_ROWS = (
    ("robot", lambda run: shown(run.log.robot)),
    ("stops scanned", lambda run: f"{run.scanned} / {len(run.asked)}"),
    ("coverage", lambda run: "" if run.acquired is None else percent(run.acquired.coverage.whole.coverage)),
    ("run time", lambda run: _clock(run.driven_s)),
    ("greatest position error at a stop", lambda run: _millimetres(run.greatest_deviation_m)),
    ("greatest cross-track error", _path_error),
    ("path recorded", lambda run: percent(run.sighted.fraction) if len(run.log.poses) else ""),
    ("stationary", lambda run: duration(run.seconds_in("PAUSED", "HELD"))),
)
"""Rows of the table of runs."""


# ---- findings, alignment and files ----


def _findings(subject: ReportSubject) -> str:
    found = subject.found
    unreached = [
        tag("li", shown(f"{room} ({area:.1f} m²) is not entered: {why}"))
        for room, area, why in found.unreached
    ]
    findings = [tag("li", tag("b", shown(code)), " ", shown(message)) for _, code, message in found.findings]
    return section("Findings", tag("ul", *unreached, *findings)) if unreached or findings else ""


def _alignments(subject: ReportSubject) -> str:
    runs = subject.comparisons
    how = (run.log.alignment.text if run.log.alignment else "recorded in the mission's frame" for run in runs)
    named = zip(runs, run_names(runs), how, strict=True)
    lines = [tag("li", shown(f"{name}: {aligned}. {_read(run)}")) for run, name, aligned in named]
    return section("Alignment", tag("ul", *lines)) if lines else ""


def _read(run: Comparison) -> str:
    source = run.log.source
    notes = "".join(f"; {note}" for note in source.notes)
    return f"{source.name} ({source.format}): {source.messages} messages read, {source.lost} lost{notes}"


def _sources(subject: ReportSubject) -> str:
    missions = [
        tag("li", shown(f"mission {item.id} revision {item.revision}: "), tag("code", shown(item.digest)))
        for item in subject.missions
    ]
    floor = subject.mission.origin
    missions.append(tag("li", shown(f"floor {floor.floor}: "), tag("code", shown(floor.floor_digest))))
    files = [tag("li", shown(f"{item.name}: "), tag("code", shown(item.digest))) for item in subject.sources]
    events = [event for run in subject.comparisons for event in run.log.events]
    scans = [
        tag(
            "li",
            shown(f"{event.stop} {event.file}, {event.points} points: "),
            tag("code", shown(event.sha256)),
        )
        for event in events
        if isinstance(event, Scanned)
    ]
    return section("Digests (sha256)", tag("ul", *missions, *files, *scans))
