"""The command line: parse, call, save, print."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from shutil import get_terminal_size
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import App, CycloptsError, MissingArgumentError, Parameter, Token

import stickslip as ss
from stickslip import __version__, console
from stickslip.answers import plain
from stickslip.arrays import units_of
from stickslip.errors import (
    InputError,
    UndecidedError,
    one_line,
    refused,
    shortened,
    shown,
    whole,
)
from stickslip.io import files
from stickslip.progress import bar, part

if TYPE_CHECKING:
    import xarray as xr


app = App(
    name="stickslip",
    help=(
        "Friction of interfaces made of many contacts: will it stick-slip, at which "
        "speeds, and what would stop it?"
    ),
    version=__version__,
    result_action="return_value",
    suppress_keyboard_interrupt=False,  # its message is ours
)


def _number(_type: object, tokens: Sequence[Token]) -> float:
    """Read a plain number, which its errors show."""
    from stickslip.model.quantities import read_number

    try:
        return read_number(tokens[0].value)
    except InputError as error:
        raise InputError(f"{shown(tokens[0].value)}: {error}") from None


Number = Annotated[float, Parameter(converter=_number)]
# the function called checks that the number is whole
Whole = Annotated[int, Parameter(converter=_number)]
Switch = Annotated[bool, Parameter(negative="")]
File = Path | None
Text = str | None
Output = Annotated[File, Parameter(alias="-o")]
RigFile = Annotated[
    Path,
    Parameter(
        help=(
            "A rig file in TOML, or the name of an example: `stickslip new` lists them."
        )
    ),
]
Json = Annotated[Switch, Parameter(help="Print JSON for a machine to read.")]
Thorough = Annotated[Switch, Parameter(help="Make all runs, however long they take.")]
Smooth = Annotated[
    tuple[str, str] | None,
    Parameter(
        help="Range of speeds to slide smoothly: '1 mm/s' '5 mm/s'.", negative=""
    ),
]
Settings = Annotated[
    tuple[str, ...],
    Parameter(
        name="--set",
        help=(
            'A key of the rig file and its value, drive.velocity="2 mm/s"; may be '
            "given again."
        ),
        negative="",
        consume_multiple=False,
    ),
]
After = Annotated[
    Text,
    Parameter(alias="--from", help="Ignore data before this time: '10 ms', or in s."),
]
Flip = Annotated[Switch, Parameter(help="Change the sign of the force.")]
Plot = Annotated[File, Parameter(help="Also draw a picture: .png, .svg or .pdf.")]
Kind = Literal[
    "overview",
    "phase",
    "energy",
    "spacetime",
    "fronts",
    "precursors",
    "slips",
    "contacts",
    "sound",
]
# kind of picture by default, by the suffix of its file
SUFFIXES: dict[str, Kind] = {".gif": "contacts", ".wav": "sound"}
KINDS = (
    "What to show of a run: by default an overview, as .gif its contacts; fronts, "
    "precursors, slips: of a chain."
)
_FAILURES_SHOWN = 5  # most failed cases of a sweep that are listed


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Columns:
    """The columns of force and time in a table, and its layout.

    Parameters
    ----------
    force
        Column of the force, by name or number from 1; if the file has no unit, followed
        by a colon and the unit: 3:mN.
    time
        Column of the time, by name or number from 1.
    step
        Sampling interval, without a time column: 0.5 ms, or in s.
    scale
        Force of one unit of the readings: '2.5 N/V'.
    to
        Ignore data after this time: '60 s', or in s.
    delimiter
        Separator of the columns, if it is not detected: ';'.
    decimal
        Decimal sign, if it is not detected: ','.
    """

    force: Text = None
    time: Text = None
    step: Text = None
    scale: Text = None
    to: Text = None
    delimiter: Text = None
    decimal: Literal[".", ","] | None = None

    def named(self) -> dict[str, Any]:
        """Return the arguments of `read_trace`."""
        from stickslip.measure.trace_reader import SCALE

        named = {key: each for key, each in vars(self).items() if key != "to"}
        scale = named.pop("scale")
        if scale is None:
            return named
        if not SCALE.fullmatch(scale):
            raise refused(
                "--scale",
                scale,
                "must be the force of one unit of the readings: '2.5 N/V', '3 mN'",
            )
        return named | {"force": f"{self.force or ''}:{scale}"}

    def refuse(self, data: Path, kind: str, **more: Any) -> None:
        """Raise `InputError` if options for tables, these or `more`, are given for data
        of another kind.
        """
        of_tables = {name: each for name, each in vars(self).items() if name != "to"}
        given = [name for name, each in (of_tables | more).items() if each]
        if given:
            raise InputError(
                f"--{given[0]}: is for a table, and {data} is {kind}; leave it out"
            )

    def cut(self, data: xr.Dataset) -> xr.Dataset:
        """Return the data up to the time given by `to`."""
        from stickslip.measure.trace import FEWEST_READINGS
        from stickslip.words import engineering

        end = _quantity(
            "--to",
            self.to,
            "s",
            "60 s",
            unit=units_of(data["time"]),
        )
        if end is None:
            return data
        before = data.sel(time=slice(None, end))
        if before.sizes["time"] < FEWEST_READINGS:
            first = engineering(float(data["time"][0]), units_of(data["time"]))
            raise InputError(
                f"--to {self.to}: fewer than {FEWEST_READINGS} samples lie before it; "
                f"the data begin at t = {first}"
            )
        return before


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class BenchValues:
    """Known values of a bench besides the force; stiffness and velocity give the motion
    of the slider.

    Parameters
    ----------
    displacement
        Column of the displacement, by name or number.
    load
        Column of the normal load, or the load itself: '20 N'.
    stiffness
        Stiffness of the driving spring: '350 N/m'.
    velocity
        Velocity of the drive: '0.1 mm/s'; or its column, by name or number.
    mass
        Mass of the slider, to compare with that of its slips: '75.6 g'.
    contacts
        Number of contacts: motion within their noise is no oscillation.
    """

    displacement: Text = None
    load: Text = None
    flip: Flip = False
    stiffness: Text = None
    velocity: Text = None
    mass: Text = None
    contacts: Whole | None = None

    def read(self, data: Path, columns: Columns) -> xr.Dataset:
        """Read a run, or a measured trace with the known values of its bench."""
        contacts = self.contacts
        if contacts is not None:
            contacts = whole("--contacts", contacts, at_least=1, hint="their number")
        from stickslip.io.table_text import read_cell

        # a number with a unit is a value, not the name of a column
        is_value = self.velocity is not None and bool(read_cell(self.velocity)[1])
        trace = _read_data(
            data,
            columns,
            displacement=self.displacement,
            load=self.load,
            velocity=None if is_value else self.velocity,
            flip=self.flip,
        )
        if self.stiffness and self.velocity and is_value:
            return ss.measure.motion(
                trace,
                stiffness=self.stiffness,
                velocity=self.velocity,
                contacts=contacts,
            )
        if self.stiffness or is_value or self.mass:
            missing = "velocity" if self.stiffness else "stiffness"
            raise InputError(
                f"--{missing}: is missing; the motion of the slider needs --stiffness "
                "and --velocity"
            )
        return trace if contacts is None else trace.assign_attrs(contacts=contacts)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Surface:
    """How heights are read, and the material of both bodies.

    Parameters
    ----------
    unit
        Unit of the heights, if the file has none: um.
    spacing
        Distance between nodes, if the file has none: '0.5 um'.
    shortest
        Leave out shorter waves: '4 um'.
    material
        glass or pmma; for others give the numbers below.
    young
        Young's modulus: '200 GPa'.
    poisson
        Poisson's ratio.
    hardness
        Largest pressure that contacts bear: '6 GPa'; elastic contacts by default.
    """

    unit: Text = None
    spacing: Text = None
    shortest: Text = None
    material: Text = None
    young: Text = None
    poisson: Number = 0.3
    hardness: Text = None

    def body(self) -> ss.surface.Material:
        """Return the material, by its name or by its numbers."""
        from stickslip.model.quantities import read_value

        if self.young is None and self.material is None:
            raise InputError(
                "--material: is missing: glass or pmma; for others give --young '200 "
                "GPa' --poisson 0.3 --hardness '6 GPa'"
            )
        given = "young" if self.young is not None else "hardness"
        if self.material is not None and getattr(self, given) is not None:
            raise InputError(
                f"--{given}: follows from --material {self.material}; leave out one of "
                "them"
            )
        if self.young is None:
            return ss.surface.material_named(str(self.material))
        young = read_value("--young", self.young, "Pa", "200 GPa")
        hardness = (
            float("inf")
            if self.hardness is None
            else read_value("--hardness", self.hardness, "Pa", "6 GPa")
        )
        return ss.surface.Material(young=young, poisson=self.poisson, hardness=hardness)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit code: 2 for input that cannot be used, 1
    for a claim or case that fails.
    """
    console.open_missing_streams()
    console.replace_missing_letters()
    try:
        code = _run(arguments)
        sys.stdout.flush()  # else the interpreter does, and reports a closed pipe
    except BrokenPipeError:  # the reader has closed the pipe, as `head` does
        console.discard_output()
        return 0
    except OSError as error:
        if error.filename is None:
            console.discard_output()
        return _fail(files.in_words(error))
    except SystemExit as left:
        # rich exits like this if the reader of a help text has closed the pipe
        if isinstance(left.__context__, BrokenPipeError):
            return 0
        raise
    return code


def _run(arguments: Sequence[str] | None) -> int:
    """Run a command, and report a failure in one line."""
    try:
        _refuse_old_names(sys.argv[1:] if arguments is None else arguments)
        with console.stoppable():
            result = app(arguments, exit_on_error=False, print_error=False)
    except (InputError, UndecidedError) as error:
        code = _fail(str(error))
        for note in getattr(error, "__notes__", ()):  # a table that helps to choose
            print(note, file=sys.stderr)
        return code
    except CycloptsError as error:
        dashed = isinstance(error, MissingArgumentError)
        hint = (
            "; a value that begins with '-' is written --NAME=VALUE" if dashed else ""
        )
        return _fail(f"{str(error).rstrip('.')}{hint} (see stickslip --help)")
    except KeyboardInterrupt:
        return _fail("interrupted; no half-written file was left behind", code=130)
    except MemoryError:
        return _fail("not enough memory for this case; take fewer contacts or samples")
    return result if isinstance(result, int) else 0


def _refuse_old_names(arguments: Sequence[str]) -> None:
    """Raise `InputError` for the former name of an option, with its present name."""
    renamed = _RENAMED.get(arguments[0], {}) if arguments else {}
    for argument in arguments[1:]:
        old = argument.partition("=")[0]
        if old in renamed:
            raise InputError(f"{old}: is called {renamed[old]} now, as in `measure`")


_RENAMED = {"fit": {"--smallest": "--minimum-drop", "--speed": "--velocity"}}
"""Former names of the options of a command, with their present names."""


def _fail(message: str, code: int = 2) -> int:
    with suppress(OSError):  # the terminal is gone, or the disk of the log is full
        print(f"stickslip: {one_line(message)}", file=sys.stderr, flush=True)
    return code


def _check_outputs(
    *outputs: Path | None,
    picture: Path | None = None,
    read: Path | None = None,
    kind: str = "",
) -> None:
    """Raise `InputError`, before any work is done, if an output cannot be written, or
    would replace the input or another output.
    """
    places = list[Path]()
    for given in (*outputs, picture):
        if given is None:
            continue
        place = files.target(given)
        with suppress(OSError):  # one of the two is not there
            if read is not None and place.samefile(read):
                raise InputError(
                    f"{given}: is the file to be read; choose another name for what is "
                    "written"
                )
        if place in places:
            raise InputError(
                f"{given}: is given for two outputs; choose another name for one of "
                "them"
            )
        places.append(place)
    if picture is not None:
        from stickslip.plot.style import format_of

        format_of(picture, kind)


def _read_data(data: Path, columns: Columns, **more: Any) -> xr.Dataset:
    """Read a run, in its units, or a measured trace."""
    from stickslip.io.datasets import is_run

    if data.is_file() and is_run(data):
        run = ss.load(data)
        if "spring_force" not in run or "time" not in run.coords:
            raise InputError(
                f"{data}: is not a run, as it has no spring_force along a time; of a "
                "measured trace write the columns as .csv"
            )
        columns.refuse(data, "a run", **more)
        return columns.cut(run)
    return columns.cut(ss.read_trace(data, **columns.named(), **more))


def _limits_of_trace(
    trace: xr.Dataset, after: str | None, minimum_drop: str | None
) -> tuple[float | None, float | None]:
    """Return the time after which a trace is evaluated, and the smallest drop that
    counts, in its units.
    """
    return (
        _quantity("--after", after, "s", "10 s", unit=units_of(trace["time"])),
        _quantity(
            "--minimum-drop",
            minimum_drop,
            "N",
            "5 mN",
            unit=units_of(trace["spring_force"]),
        ),
    )


def _quantity(
    option: str, text: str | None, si: str, example: str, *, unit: str
) -> float | None:
    """Return a quantity in the unit of the data; a number without a unit is in SI units
    or, if the unit of the data is not known, in that.
    """
    from stickslip.io.headings import ratio
    from stickslip.model.quantities import read_number, read_quantity

    if text is None:
        return None
    size = ratio(si, unit)
    try:
        return (
            read_number(text)
            if size is None
            else size * read_quantity(text, si, example, bare=True)
        )
    except InputError as error:
        raise InputError(f"{option}: {shown(text)}: {error}") from None


def _draw(picture: Path | None, figure: Callable[[], Any]) -> None:
    """Draw and save a figure, if a file is given for it."""
    if picture is not None:
        ss.plot.save(figure(), picture)


def _answer(text: object, content: Any, json: bool, **written: Path | None) -> None:
    """Print an answer: as JSON, or as a text, followed by the files written."""
    if json:
        console.print_json(content)
    else:
        print(
            text,
            *(
                f"{name}: {place}"
                for name, place in written.items()
                if place is not None
            ),
            sep="\n",
        )


app.command(
    "stickslip.rate_state.command:rsf",
    help=(
        "Report whether a rig's friction follows rate-and-state laws, and their a, b "
        "and D; fit a velocity step."
    ),
)


app.command(
    "stickslip.structures.command:export",
    help="Write the interface for Simulink, Modelica, MuJoCo: FMU, table, A B C D.",
)


def _rig_with(path: Path, settings: Sequence[str]) -> ss.Rig:
    """Read a rig, with the keys that the command line sets."""
    from stickslip.io.settings import read_rig_with  # slow to import

    return read_rig_with(path, settings)


@app.command
def predict(
    rig: RigFile,
    *,
    settings: Settings = (),
    fast: Switch = False,
    thorough: Thorough = False,
    smooth: Smooth = None,
    details: Switch = False,
    json: Json = False,
    plot: Plot = None,
) -> None:
    """Predict whether a rig stick-slips, at which speeds, by what margin, and what
    would stop it.

    The verdict comes first, on standard error; the rest takes some 10 s.

    Parameters
    ----------
    fast
        Stop at the verdict: linear theory and one run.
    details
        Print all: evidence, margins, and changes tried.
    """
    from stickslip.advise import complete, predict
    from stickslip.advise.sections import ARROWS

    if fast and thorough:
        raise InputError("--fast: excludes --thorough; leave out one of them")
    _check_outputs(picture=plot, read=rig)
    described = _rig_with(rig, settings)
    with console.working("predicting") as progress:
        found = predict(described, fast=True, smooth=smooth, progress=progress)
    if not fast:
        if sys.stderr.isatty():
            print(f"{found.headline}\n... looking for mitigations", file=sys.stderr)
        with console.working("predicting") as progress:
            found = complete(
                found, thorough=thorough, pairs=smooth is not None, progress=progress
            )
    _draw(plot, found.plot)
    on_terminal = sys.stdout.isatty()
    text = found.text(
        get_terminal_size().columns if on_terminal else 80,
        details=details,
        bold=on_terminal,
        signs=on_terminal and console.can_write("".join(ARROWS)),
    )
    _answer(text, found.to_dict(), json, picture=plot)


@app.command
def report(
    rig: RigFile,
    *,
    settings: Settings = (),
    output: Annotated[Path, Parameter(alias="-o")] = Path("report.html"),
    thorough: Thorough = False,
    smooth: Smooth = None,
) -> None:
    """Write the answer of `predict` with its pictures as one HTML page, to forward or
    print.

    Parameters
    ----------
    output
        File of the page.
    """
    from stickslip.advise.report import report

    _check_outputs(picture=output, read=rig, kind="page")
    described = _rig_with(rig, settings)
    with console.working("predicting") as progress:
        found = ss.predict(
            described,
            thorough=thorough,
            smooth=smooth,
            progress=part(progress, 0.0, 0.7),
        )
        files.write(output, report(found, progress=part(progress, 0.7, 1.0)).encode())
    print(f"{found.headline}\nreport: {output}")


@app.command
def new(
    example: Text = None,
) -> None:
    """Print a rig file to start from: `stickslip new brake_pad > my.toml`.

    Parameters
    ----------
    example
        Name of a rig; without one, all examples are listed.
    """
    from stickslip.io import rig_files as rigs

    if example is None:
        for name in rigs.example_names():
            print(f"{name:16} {rigs.read_rig(rigs.example_file(name)).name}")
    else:
        print(rigs.example_file(example).read_text(encoding="utf-8"), end="")


@app.command
def simulate(
    rig: RigFile,
    *,
    settings: Settings = (),
    output: Output = None,
    long: Switch = False,
    json: Json = False,
    plot: Plot = None,
) -> None:
    """Simulate a rig and report its regime and slips.

    Parameters
    ----------
    output
        Write the run as NetCDF, from which it can be repeated.
    long
        Run even if it takes more than an hour, or 4 GB of memory.
    """
    from stickslip.io.rig_files import to_toml

    _check_outputs(output, picture=plot, read=rig)
    files.check_suffix(output, "a run", ".nc")
    described = _rig_with(rig, settings)
    text = to_toml(described)  # before the run, as it may raise an error
    with console.working("simulating") as progress:
        run = ss.simulate(described, progress=progress, long=long)
    _keep_run(run.assign_attrs(rig=text), output, plot, json)


@app.command
def rerun(
    run: Path,
    *,
    output: Output = None,
    json: Json = False,
    plot: Plot = None,
) -> None:
    """Repeat a run from its provenance, bit for bit, and report its regime and slips.

    Parameters
    ----------
    run
        A run (NetCDF) that `stickslip simulate` wrote.
    output
        Write the new run as NetCDF.
    """
    _check_outputs(output, picture=plot, read=run)
    files.check_suffix(output, "a run", ".nc")
    before = ss.load(run)
    with console.working("simulating") as progress:
        again = ss.rerun(before, progress=progress)
    _keep_run(
        again.assign_attrs(before.attrs | again.attrs),
        output,
        plot,
        json,
    )


def _keep_run(
    run: xr.Dataset, output: Path | None, plot: Path | None, json: bool
) -> None:
    """Write a run and its picture, and report its regime and slips."""
    if output is not None:
        ss.save(run, output)
    seen = ss.regime(run)
    _draw(plot, lambda: ss.plot.overview(run))
    content = {"regime": plain(seen), "output": plain(output)}
    _answer(
        _motion(run, seen),
        content,
        json,
        run=output,
        picture=plot,
    )


def _motion(run: xr.Dataset, seen: object) -> str:
    """Return the motion in words: its regime or, on a ramp, where it changes; and the
    fronts of an elastic slider.
    """
    from stickslip.measure.fronts import in_words as of_fronts
    from stickslip.measure.ramps import in_words as of_a_ramp

    return "\n".join([of_a_ramp(run) or str(seen), *of_fronts(run)])


@app.command
def measure(
    data: Path,
    *,
    columns: Columns = Columns(),
    bench: BenchValues = BenchValues(),
    minimum_drop: Text = None,
    after: After = None,
    events: File = None,
    curve: File = None,
    json: Json = False,
    plot: Annotated[Plot, Parameter(alias="-o")] = None,
) -> None:
    """Classify the motion and list the slips of a run or of a measured force trace.

    Parameters
    ----------
    data
        A run (NetCDF), or a table in plain text with a column of force.
    minimum_drop
        Smallest drop that counts as a slip: '5 mN', or in N.
    events
        Write the catalogue of slips as CSV.
    curve
        Write friction against speed as CSV, or draw it: .png, .svg or .pdf.
    """
    from stickslip.io.datasets import as_csv
    from stickslip.words import engineering

    _check_outputs(events, curve, picture=plot, read=data)
    files.check_suffix(events, "the catalogue of slips", ".csv")
    if curve is not None and curve.suffix != ".csv":
        _check_outputs(picture=curve)
    trace = bench.read(data, columns)
    since, smallest = _limits_of_trace(trace, after, minimum_drop)
    seen, catalogue = ss.measure.regime_and_drops(
        trace, minimum_drop=smallest, after=since
    )
    about = catalogue.attrs
    note = trace.attrs.get("note")
    kept = trace.sel(time=slice(since, None))
    moves = ss.measure.kinematics(kept, mass=bench.mass) if bench.stiffness else None
    if events is not None:
        files.write(events, as_csv(catalogue).encode())
    speeds = _friction_at_speeds(kept, curve)
    _draw(plot, lambda: ss.plot.overview(trace, events=catalogue, seen=seen))
    statistics = {
        str(name): {key: plain(each.attrs[key]) for key in ("mean", "std", "units")}
        for name, each in catalogue.data_vars.items()
        if "mean" in each.attrs
    }
    content = {
        "regime": plain(seen),
        "statistics": statistics
        | {"count": about["count"], "drops_are": about["drops_are"]},
        "events": {
            str(name): plain(catalogue[name].to_numpy()) for name in catalogue.variables
        },
        "kinematics": plain(moves),
        "speeds": speeds and {str(k): plain(v.values) for k, v in speeds.items()},
        "read": plain(trace.attrs.get("read")),
        "note": plain(note),
    }
    means = ss.measure.statistics(catalogue)
    head = ss.measure.counted(catalogue)
    if means:
        where = "in all of the data"
        if since is not None:
            where = f"after t = {engineering(since, units_of(trace['time']))}"
        head += f" {where}; mean ± standard deviation:"
    lines = [
        _motion(kept, seen),
        *([str(moves)] if moves else []),
        "",
        head,
        *(f"{name}: {text}" for name, text in means),
        *_speeds_in_words(speeds),
        *([f"note: {note}"] if note else []),
        *([f"read: {read}"] if (read := trace.attrs.get("read")) else []),
    ]
    written = {about["drops_are"]: events, "curve": curve, "picture": plot}
    _answer("\n".join(lines), content, json, **written)


def _friction_at_speeds(trace: xr.Dataset, written: Path | None) -> xr.Dataset | None:
    """Return friction against speed, if a trace shows it, and write or draw it if a
    file is given.
    """
    from stickslip.io.datasets import as_csv

    try:
        found = ss.measure.friction_at_speeds(trace)
    except InputError:  # most records hold no speed
        if written is None:
            return None
        raise
    if written is None:
        return found if found.sizes["speed"] > 1 else None
    if written.suffix == ".csv":
        files.write(written, as_csv(found).encode())
    else:
        _draw(written, lambda: ss.plot.friction_at_speeds(found))
    return found


def _speeds_in_words(speeds: xr.Dataset | None) -> list[str]:
    """Return friction against speed, in one line for each speed."""
    from stickslip.words import engineering

    if speeds is None:
        return []
    lines = ["", "friction against speed (± standard error):"]
    for one in (speeds.isel(speed=k) for k in range(speeds.sizes["speed"])):
        speed, mean, error = (
            engineering(
                float(one[key]),
                units_of(one[key]),
                digits,
            )
            for key, digits in (("velocity", 3), ("friction", 4), ("error", 2))
        )
        lines.append(f"{speed}: {mean} ± {error}")
    return [*lines, ""]


@app.command
def plot(
    data: Path,
    output: Path,
    *,
    kind: Annotated[Kind | None, Parameter(help=KINDS)] = None,
    beside: File = None,
    columns: Columns = Columns(),
    at: Text = None,
    bistable: Switch = False,
) -> None:
    """Draw a run, a measured trace or a sweep.

    Parameters
    ----------
    data
        A run (NetCDF), a table in plain text, or the store of a sweep.
    output
        The picture: .png, .svg or .pdf; a film: .gif; a sound: .wav.
    beside
        Another run: draw both forces on one scale.
    at
        Section of a sweep to draw: delay=0.1,start=sliding.
    bistable
        In a sweep, also show where stick-slip ends.
    """
    from stickslip.sweep import is_store

    swept = is_store(data)
    _refuse_options_of_others(data, swept, kind, beside, columns, at, bistable)
    kind = (
        "overview"
        if swept or beside
        else kind or SUFFIXES.get(output.suffix.lower(), "overview")
    )
    _check_outputs(picture=output, read=data, kind=kind)
    if swept:
        from stickslip.sweep.plan import open_plan

        print(
            "on top: "
            f"{_draw_sweep(_cut(open_plan(data), at), output, bistable=bistable)}"
        )
    else:
        trace = _read_data(data, columns)
        with bar("drawing") as progress:
            if beside is not None:
                figure: Any = ss.plot.side_by_side(trace, _read_data(beside, columns))
            elif kind == "contacts":
                figure = ss.plot.contacts(trace, progress=part(progress, 0.0, 0.5))
            else:
                names = {"phase": "phase_portrait", "slips": "slip_profiles"}
                figure = getattr(ss.plot, names.get(kind, kind))(trace)
                figure = getattr(figure, "figure", figure)  # of axes
            ss.plot.save(figure, output, progress=part(progress, 0.5, 1.0))
    written = {"contacts": "film", "sound": "sound"}.get(kind, "picture")
    print(f"{written}: {output}")


def _refuse_options_of_others(
    data: Path,
    swept: bool,
    kind: Kind | None,
    beside: Path | None,
    columns: Columns,
    at: str | None,
    bistable: bool,
) -> None:
    """Raise `InputError` for options of `plot` that do not apply to these data."""
    if swept:
        columns.refuse(data, "a sweep", to=columns.to)
        for name, given in (("kind", kind), ("beside", beside)):
            if given is not None:
                raise InputError(f"--{name}: is not for a sweep; leave it out")
    elif at is not None or bistable:
        name = "bistable" if at is None else "at"
        raise InputError(f"--{name}: is for a sweep, which {data} is not; leave it out")
    elif beside is not None and kind not in (None, "overview"):
        raise InputError(
            f"--kind {kind}: excludes --beside, an overview; leave out one of them"
        )


@app.command
def fit(
    trace: Path,
    *,
    stiffness: Text = None,
    velocity: Text = None,
    mass: Text = None,
    load: Text = None,
    speeds: File = None,
    holds: File = None,
    columns: Columns = Columns(),
    flip: Flip = False,
    minimum_drop: Text = None,
    after: After = None,
    output: Output = None,
    json: Json = False,
    plot: Plot = None,
) -> None:
    """Fit a rig to a measured stick-slip trace, with intervals; the first time,
    simulations take minutes.

    Parameters
    ----------
    trace
        A table in plain text with a column of force, or a run (NetCDF).
    stiffness
        Stiffness of the driving spring: '350 N/m'.
    velocity
        Velocity of the drive: '0.1 mm/s'; by default that of a column of the trace.
    mass
        Mass of the slider: '0.4 kg'.
    load
        Normal load: '20 N'.
    speeds
        Table of speeds (m/s) and mean forces (N), to fit the delay.
    holds
        Table of holds (s) and static friction (N), to fit ageing.
    minimum_drop
        Smallest drop that counts as a slip: '5 mN', or in N.
    output
        Write the rig; needs --stiffness.
    """
    from stickslip.fitting.bench import read_pairs
    from stickslip.io.rig_files import to_toml

    _check_outputs(output, picture=plot, read=trace)
    files.check_suffix(output, "a rig", ".toml")
    if output is not None and stiffness is None:
        raise InputError(
            f"-o {output}: a rig needs the stiffness of the driving spring, without "
            "which a force trace gives no "
            "length; give --stiffness '350 N/m'"
        )
    given = {"stiffness": stiffness, "velocity": velocity, "mass": mass, "load": load}
    known = {name: value for name, value in given.items() if value is not None}
    means = read_pairs(speeds, "m/s")
    peaks = read_pairs(holds, "s")
    data = _read_data(trace, columns, flip=flip)
    since, least = _limits_of_trace(data, after, minimum_drop)
    with console.working("simulating") as progress:
        found = ss.fit(
            data,
            known=known,
            minimum_drop=least,
            after=since,
            speeds=means,
            holds=peaks,
            progress=progress,
        )
        if output is not None:
            files.write(output, to_toml(found.rig(name=trace.stem)).encode())
    _draw(plot, found.plot)
    written = {"rig": output, "picture": plot}
    _answer(
        found,
        found.to_dict()
        | {name: str(place) for name, place in written.items() if place},
        json,
        **written,
    )


@app.command
def surface(
    heights: Path,
    *,
    pressure: str,
    options: Surface = Surface(),
    rig: Path | None = None,
    friction: Number = 0.4,
    length: Literal["renewal", "elastic"] | None = None,
    output: Output = None,
    json: Json = False,
    plot: Plot = None,
) -> None:
    """Press a measured surface on a flat one, and estimate the interface of a rig from
    its contacts.

    Parameters
    ----------
    heights
        A map of heights: .npz, .csv or .asc; other formats need SurfaceTopography.
    pressure
        Load over the area: '2 MPa'.
    rig
        Rig file of the machine, whose interface is replaced; by default the example
        pmma_slider.
    friction
        Friction coefficient, which scales the elastic length; a map does not give it.
    length
        Which length applies, if known; by default the rig has a range over both.
    output
        Write the rig.
    """
    from stickslip.io.rig_files import to_toml
    from stickslip.words import engineering

    _check_outputs(output, picture=plot, read=heights)
    files.check_suffix(output, "a rig", ".toml")
    body = options.body()
    read = ss.surface.read(heights, unit=options.unit, spacing=options.spacing)
    with bar("pressing") as progress:
        found = ss.surface.contacts(
            read,
            pressure=pressure,
            material=body,
            shortest=options.shortest,
            progress=progress,
        )
    estimate = ss.surface.estimate(found, friction=friction)
    machine = ss.surface.rig(
        estimate, rig or "pmma_slider", length=length, name=heights.stem
    )
    if output is not None:
        files.write(output, to_toml(machine).encode())
    _draw(plot, lambda: ss.plot.surface(found, estimate))
    nodes = " x ".join(str(size) for size in read.shape)
    apart = engineering(float(read["x"][1]), "m")
    rms = engineering(float(read.std()), "m")
    lines = [
        f"{heights.name}: {estimate}",
        f"read: {nodes} nodes, {apart} apart, {rms} rms",
    ]
    if output is not None and rig is None:
        lines.append("machine: the example pmma_slider; give yours by --rig")
    content = estimate.to_dict() | {"rig": plain(output)}
    _answer("\n".join(lines), content, json, rig=output, picture=plot)


@app.command
def map(
    rig: RigFile,
    *,
    settings: Settings = (),
    over: str = "stiffness,velocity",
    around: Number = 30.0,
    points: Whole = 80,
    bistable: Switch = False,
    output: Annotated[Path, Parameter(alias="-o")] = Path("map.png"),
    json: Json = False,
) -> None:
    """Draw where smooth sliding is stable over two parameters of a rig, by linear
    theory.

    Parameters
    ----------
    over
        Two parameters, such as stiffness,velocity.
    around
        Factor on either side of the rig's own point.
    points
        Points of the map along each parameter.
    bistable
        Also show where stick-slip persists beside smooth sliding.
    output
        The picture.
    """
    from stickslip.advise import chart

    _check_outputs(picture=output, read=rig)
    names = tuple(part.strip() for part in over.split(","))
    if len(names) != 2:
        raise InputError(
            f"--over {shortened(over)}: must name two parameters, such as "
            "stiffness,velocity"
        )
    described = _rig_with(rig, settings)
    with console.working("mapping") as progress:
        found = chart(
            described,
            (names[0], names[1]),
            around,
            points,
            bistable=bistable,
            progress=progress,
        )
    _draw(output, lambda: ss.plot.chart(found))
    content = {
        str(name): plain(found[name].to_numpy()) for name in found.variables
    } | plain(dict(found.attrs))
    _answer(found.attrs["summary"], content, json, picture=output)


@app.command
def sweep(
    file: File = None,
    *,
    store: Path,
    status: Switch = False,
    workers: Whole | None = None,
    processes: Switch = False,
    scheduler: Text = None,
    retry_failed: Switch = False,
    json: Json = False,
    plot: Plot = None,
) -> int:
    """Run many cases over the parameters of a rig; started again with the same store,
    run the missing ones.

    Failed cases are recorded, and the others still run; the exit code is then 1.

    Parameters
    ----------
    file
        A sweep file in TOML; `stickslip new phase_diagram` prints one.
    store
        File of the results; if it exists, the sweep continues.
    status
        Run nothing, but report how far the sweep is.
    workers
        Number of cases run at the same time; by default one per core.
    processes
        Run cases in processes, not in threads.
    scheduler
        Run cases on a Dask cluster: tcp://HOST:PORT.
    retry_failed
        Repeat failed cases.
    """
    from stickslip.sweep import status_of
    from stickslip.sweep.plan import read_plan

    _check_outputs(picture=plot, read=file)
    if status:
        if plot is not None:
            raise InputError(
                "--plot: is not drawn with --status; `stickslip plot STORE PICTURE` "
                "draws what is done"
            )
        found = status_of(store)
        _answer(found, plain(found), json)
        return 0
    if file is None:
        raise InputError(
            "sweep: missing FILE; give a sweep file (`stickslip new phase_diagram` "
            "prints one)"
        )
    plan = read_plan(file)
    with (
        console.executor_of(workers, processes, scheduler) as executor,
        console.progress_of(plan.name) as report,
    ):
        try:
            result = plan.run(
                store=store,
                executor=executor,
                progress=report,
                retry_failed=retry_failed,
            )
        except KeyboardInterrupt:
            if not store.exists():
                return _fail("interrupted; nothing was done yet", code=130)
            kept = status_of(store).summary
            cases = (
                f"{kept.done + kept.failed} of {kept.total} cases are kept in "
                f"{str(store)!r}"
            )
            return _fail(
                f"interrupted; {cases}; repeat the command to continue", code=130
            )
    return _report_sweep(result, store, plot, json)


def _report_sweep(
    result: xr.Dataset, store: Path, picture: Path | None, json: bool
) -> int:
    """Report the cases of a sweep; return exit code 1 if any failed."""
    from stickslip.sweep import failures, summary
    from stickslip.sweep.study import KINDS

    theory = None if picture is None else _draw_sweep(result, picture)
    counted = summary(result)
    failed = failures(result)
    crossings = result.sizes.get("crossing")
    codes = result["regime"].to_numpy().ravel().tolist() if "regime" in result else []
    regimes = {
        kind: codes.count(code) for code, kind in enumerate(KINDS) if code in codes
    }
    line = str(counted) + (
        ""
        if crossings is None
        else f"; {crossings} points found where the regime changes"
    )
    about = {
        "line": line,
        "regimes": regimes,
        "failures": failed,
        "crossings": crossings,
        "store": store,
        "picture": picture,
        "theory": theory,
    }
    content = plain(counted) | plain(about)
    lines = [
        *(f"{kind}: {count}" for kind, count in regimes.items()),
        f"store: {store}",
        *([] if picture is None else [f"picture: {picture}, on top: {theory}"]),
        *(f"failed: {failure}" for failure in failed[:_FAILURES_SHOWN]),
    ]
    if len(failed) > _FAILURES_SHOWN:
        lines.append(
            f"failed: ... and {len(failed) - _FAILURES_SHOWN} more, in the variable "
            "error of the store"
        )
    _answer("\n".join([*lines, line]), content, json)
    return 1 if failed else 0


def _draw_sweep(result: xr.Dataset, picture: Path, *, bistable: bool = False) -> str:
    """Draw a sweep with results of theory on top; return in words what these are, or
    why there are none.
    """
    from stickslip.sweep.theory import with_theory

    with console.working("drawing") as progress:
        result = with_theory(result, bistable=bistable, progress=progress)
    ss.plot.save(ss.plot.sweep_picture(result), picture)
    return str(result.attrs["theory"])


def _cut(result: xr.Dataset, at: str | None) -> xr.Dataset:
    """Return the section of a sweep at the values nearest to those given."""
    from stickslip.model.quantities import read_number

    for given in at.split(",") if at else ():
        name, _, value = (word.strip() for word in given.partition("="))
        try:
            numeric = result[name].dtype.kind in "iuf"
            result = result.sel(
                {name: read_number(value) if numeric else value},
                method="nearest" if numeric else None,
            )
        except (KeyError, ValueError):
            there = "; ".join(
                f"{axis} = {result[axis].to_numpy().tolist()}" for axis in result.dims
            )
            raise InputError(
                f"--at {shortened(given)}: must be an axis and a value of the sweep, "
                f"as in delay=0.1; it has {there}"
            ) from None
    return result


@app.command
def paper(
    figure: str,
    *,
    check: Switch = False,
    quick: Switch = False,
    output: Annotated[Path, Parameter(alias="-o")] = Path(),
    formats: Annotated[
        list[Literal["png", "pdf", "svg"]] | None,
        Parameter(name="--format", negative="", consume_multiple=True),
    ] = None,
    json: Json = False,
) -> int:
    """Make a figure of the paper, or all of them: picture, data, caption and, with
    --check, its claims with verdicts.

    Parameters
    ----------
    figure
        fig1, fig2 ... or all
    check
        Check the paper's claims; exit code 1 if one fails.
    quick
        Use fewer points and contacts.
    output
        Directory for pictures and data; created if missing.
    formats
        One or several formats of the picture.
    """
    from stickslip.paper import figures_named, places, reproduce

    kinds = formats or ["png"]
    chosen = figures_named(figure)
    for one in chosen:  # before any work is done
        places(one, output, kinds)
    made = []
    for one in chosen:
        with console.working(one.name) as progress:
            made.append(
                reproduce(
                    one,
                    output,
                    formats=kinds,
                    check=check,
                    quick=quick,
                    progress=progress,
                )
            )
        if not json:
            print(made[-1], end="\n\n" if one is not chosen[-1] else "\n", flush=True)
    ok = all(one.ok for one in made)
    if json:
        console.print_json({"figures": [one.to_dict() for one in made], "ok": ok})
    return 0 if ok else 1


@app.command
def explore(
    rig: File = None,
    *,
    port: Whole | None = None,
    browser: bool = True,
    share: bool = False,
) -> None:
    """Open the explorer in a browser: move a control and see sliding turn into
    stick-slip.

    Parameters
    ----------
    rig
        A rig file in TOML to start from.
    port
        Port on this machine; 0 for any free one.
    browser
        Open the page in the browser.
    share
        Serve it to the local network, too, behind a secret link.
    """
    from stickslip import explorer

    def ready(address: str) -> None:
        print(f"stickslip explorer: {address} (stop it with Ctrl-C)", flush=True)
        if share:
            print(explorer.EXPOSED, flush=True)
        if browser:
            import webbrowser

            webbrowser.open(address)

    explorer.serve(rig, port=port, ready=ready, share=share)
