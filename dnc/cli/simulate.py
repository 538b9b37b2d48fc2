"""`dnc simulate`: run a program on the virtual mill without a line, cut the part and measure it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dnc.cli._options import File, machine_option
from dnc.numbers import Number

if TYPE_CHECKING:
    from sim.deviation import Verdict
    from sim.mill import Recording
    from sim.nominal import Nominal

_PATH = File()


@click.command(
    short_help="cut and measure a program on the virtual mill, no line",
    epilog="Example: dnc simulate part.mpf --job job.toml --report cut.json --plot cut.png",
)
@click.argument("program", type=_PATH)
@machine_option
@click.option("--job", type=_PATH, help="job file: design surface and tool; without it nothing is measured")
@click.option("--pitch", "pitch_mm", type=Number(0.001, 1000), help="probe pitch in mm; R/40 unless given")
@click.option("--motion", type=_PATH, help="write the motion log (CSV, tool tip)")
@click.option("--report", type=_PATH, help="write the report (JSON)")
@click.option("--plot", type=_PATH, help="draw the deviation map (PNG)")
@click.option("--map", "deviation_map", type=_PATH, help="write the deviation of every probe (.csv or .ply)")
@click.option("--view", type=_PATH, help="write a page to look at (HTML, self-contained)")
@click.option("--json", "as_json", is_flag=True, help="print the report to stdout")
def command(
    program: Path,
    machine: str,
    job: Path | None,
    pitch_mm: float | None,
    motion: Path | None,
    report: Path | None,
    plot: Path | None,
    deviation_map: Path | None,
    view: Path | None,
    as_json: bool,
) -> int:
    """Interpret, time, cut and measure PROGRAM; no line is used and no machine moves.

    Subprograms are looked for beside PROGRAM.
    """
    import json

    from dnc.errors import ExitCode
    from dnc.profile import load_profile, profile_path
    from dnc.progress import working
    from planner.files import check_outputs, read_program, write_file
    from planner.job import load_job
    from sim.grid import check_pitch
    from sim.mill import rehearse
    from sim.nominal import load_nominal
    from sim.profile import load_mill_profile

    if job is None and (plot or deviation_map or view or pitch_mm):
        raise click.UsageError("--plot, --map, --view and --pitch need the design; name the job file with --job")
    check_outputs([motion, report, plot, deviation_map, view], [program, job])
    if plot is not None:
        from sim.plot import require_drawing

        require_drawing()
    load_profile(profile_path(machine))  # whose keys the mill's own half does not all know
    nominal = load_nominal(job) if job is not None else None
    if nominal is not None:
        check_pitch(nominal.patches, _pitch_mm(nominal, pitch_mm), 2 * nominal.cutter.radius_mm)
    data = read_program(program)
    with working(f"cutting {program.name}" + ("" if job is None else " and measuring it")):
        recording = rehearse(
            data,
            load_mill_profile(profile_path(machine)),
            tool_radii_mm=None if job is None else load_job(job).tool_radii_mm,
            subprogram_folder=program.parent,
        )
        verdict = _verdict(nominal, recording, pitch_mm) if nominal is not None else None
    made = _report(program, data, machine, recording, verdict)
    if motion is not None:
        write_file(motion, _motion_csv(recording, nominal).encode())
    if report is not None:
        write_file(report, (json.dumps(made, indent=1) + "\n").encode())
    if verdict is not None:
        _draw(verdict, plot, deviation_map)
    if view is not None and verdict is not None:
        _write_view(view, verdict, recording, data, f"{machine}: {_text(made).removeprefix('SIMULATED')}")
    click.echo(json.dumps(made, indent=1) if as_json else _text(made))
    return int(ExitCode.CONTROL if recording.alarms else ExitCode.OK)


def _verdict(nominal: Nominal, recording: Recording, pitch_mm: float | None) -> Verdict:
    from sim.deviation import judge
    from sim.tool import tool_of

    return judge(
        nominal,
        tool_of(nominal.cutter),
        recording.travelled,
        reference=nominal.reference,
        probe_pitch_mm=_pitch_mm(nominal, pitch_mm),
    )


def _pitch_mm(nominal: Nominal, asked_mm: float | None) -> float:
    return nominal.cutter.radius_mm / 40 if asked_mm is None else asked_mm


def _draw(verdict: Verdict, plot: Path | None, deviation_map: Path | None) -> None:
    if plot is not None:
        from sim.plot import plot_deviation

        plot_deviation(verdict, plot)
    if deviation_map is not None:
        from sim.export import write_map

        write_map(verdict, deviation_map)


def _write_view(view: Path, verdict: Verdict, recording: Recording, data: bytes, title: str) -> None:
    from sim.view import page_of, write_page

    write_page(page_of(verdict, recording.travelled, data, title, nodes=60_000, pieces=100_000), view)


def _report(program: Path, data: bytes, machine: str, recording: Recording, verdict: Verdict | None) -> dict[str, Any]:
    import hashlib

    from sim.peaks import peaks

    samples = recording.samples
    acceleration, jerk = peaks(samples.t_s, samples.position_mm)
    measured = verdict.report() if verdict is not None else {}
    return {
        "schema": "dripmill.simulate",
        "version": 1,
        "simulated": True,
        "program": program.name,
        "sha256": hashlib.sha256(data).hexdigest(),
        "machine": machine,
        "is_completed": recording.is_completed,
        "alarms": [
            {"number": alarm.number, "line": alarm.line, "block": alarm.block, "text": alarm.text}
            for alarm in recording.alarms
        ],
        "machining_time_s": recording.machining_time_s,
        "starved_s": sum(interval.duration_s for interval in recording.starved),
        "blocks": recording.blocks,
        "peak_acceleration_mm_s2": acceleration,
        "peak_jerk_mm_s3": jerk,
        **measured,
    }


def _motion_csv(recording: Recording, nominal: Nominal | None) -> str:
    """The motion log of the tool tip; where the program drives the ball's centre the tip is one radius lower."""
    is_centre = nominal is not None and nominal.reference == "centre"
    drop_mm = nominal.cutter.corner_mm if nominal is not None and is_centre else 0.0
    samples = recording.samples
    rows = zip(
        samples.t_s.tolist(),
        samples.position_mm.tolist(),
        samples.feed_mm_min.tolist(),
        samples.line.tolist(),
        samples.block.tolist(),
        strict=True,
    )
    lines = [
        f"{t:.4f},{x:.6f},{y:.6f},{z - drop_mm:.6f},{feed:.3f},{line},{block if block >= 0 else ''}"
        for t, (x, y, z), feed, line, block in rows
    ]
    return "\n".join(["t_s,x_mm,y_mm,z_mm,feed_mm_min,line,block", *lines]) + "\n"


def _text(made: dict[str, Any]) -> str:
    """The report for a person, one figure a line."""
    from dnc.progress import printable

    minutes, seconds = divmod(made["machining_time_s"], 60.0)
    lines = [
        f"SIMULATED  {made['program']}: {made['blocks']} blocks, {int(minutes)} min {seconds:.1f} s",
        *(f"ALARM {alarm['number']} line {alarm['line']}: {alarm['text']}" for alarm in made["alarms"]),
    ]
    return "\n".join(map(printable, [*lines, *_measured(made)] if "scallop_mm" in made else lines))


def _measured(made: dict[str, Any]) -> list[str]:
    """What was measured, one figure a line; a scallop speaks of the covered places only, and says so."""
    rest = f", {made['probes']} probes"
    scallop = f"{made['scallop_mm'] * 1000:9.3f} um{_where(made['worst_scallops'])}"
    if made["coverage"] < 1.0:
        rest += f"; on all else stands more than {made['reach_mm']:g} mm of material"
        scallop += ", of the covered places only"
    if made["coverage"] == 0.0:
        scallop = "none measured: no place of the surface is covered"
    lines = [
        f"scallop    {scallop}",
        f"gouge      {made['gouge_mm'] * 1000:9.3f} um{_where(made['worst_gouges'])}",
        f"coverage   {_percent_at_most(made['coverage']):9.3f} %  of the surface{rest}",
    ]
    if made["inaccessible"] > 0:
        lines.append(
            f"apart      {made['inaccessible'] * 100:9.3f} %  of the surface, which this cutter cannot touch without "
            "cutting elsewhere"
        )
    return lines


def _percent_at_most(share: float) -> float:
    """The share in per cent, cut to the three decimals that are shown: 100 means all."""
    return int(share * 1e5) / 1e3


def _where(places: list[dict[str, Any]]) -> str:
    if not places:
        return ""
    x, y, z = places[0]["position_mm"]
    block = "" if places[0]["block"] is None else f", N{places[0]['block']}"
    return f"  at X{x:.3f} Y{y:.3f} Z{z:.3f}, line {places[0]['line']}{block}"
