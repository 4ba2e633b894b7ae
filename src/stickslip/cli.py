"""The command line: parse, call, save, print."""

from __future__ import annotations

import json as jsonlib
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import App, CycloptsError, Parameter

from stickslip import __version__
from stickslip.errors import InputError, UndecidedError

if TYPE_CHECKING:
    import xarray as xr

    from stickslip.advise import Prediction
    from stickslip.rig import Rig

app = App(
    name="stickslip",
    help="Friction of interfaces made of many contacts: will it stick-slip, at which speeds, and what would stop it?",
    version=__version__,
    result_action="return_value",
)

Json = Annotated[bool, Parameter(help="Print JSON for a machine to read.", negative="")]
Plot = Annotated[Path | None, Parameter(help="Also draw a picture: .png, .svg or .pdf.")]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit code: 2 for input that cannot be used, 1 for a claim or case that fails."""
    try:
        result = app(list(sys.argv[1:] if arguments is None else arguments), exit_on_error=False, print_error=False)
    except (InputError, UndecidedError) as error:
        return _fail(str(error))
    except CycloptsError as error:
        return _fail(f"{' '.join(str(error).split())} (see stickslip --help)")
    except KeyboardInterrupt:
        return _fail("interrupted; no half-written file was left behind", code=130)
    except BrokenPipeError:  # the reader went away, as `head` does
        sys.stderr.close()
        return 0
    except MemoryError:
        return _fail("not enough memory for this case; take fewer contacts or samples")
    return result if isinstance(result, int) else 0


def _fail(message: str, code: int = 2) -> int:
    print("stickslip: " + " ".join(message.split()), file=sys.stderr)
    return code


# ---------------------------------------------------------------------------------------------------------------------
# Commands
# ---------------------------------------------------------------------------------------------------------------------


@app.command
def predict(rig: Path, *, verify: bool = False, json: Json = False, plot: Plot = None) -> None:
    """Say whether a rig will stick-slip, with margins and remedies.

    Parameters
    ----------
    rig
        A rig file in TOML; see examples/pmma_slider.toml.
    verify
        Simulate the rig after each remedy with its own method.
    """
    from stickslip import advise
    from stickslip import rig as rigs

    _check_target(plot)
    described = rigs.read(rig)
    with _bar("predicting") as progress:
        found = advise.predict(described, verify=verify, progress=progress)
    if plot is not None:
        from stickslip import plot as drawing

        shown = described.in_its_units(found.run)
        drawing.save(drawing.overview(shown), plot)
    if json:
        _print_json(_prediction_as_plain(found, described))
    else:
        _print_prediction(found, described, plot)


@app.command
def simulate(
    rig: Path,
    *,
    output: Annotated[
        Path | None, Parameter(alias="-o", help="Write the run as NetCDF; it can be made again from it.")
    ] = None,
    again: Annotated[bool, Parameter(help="RIG is a run: make it again from its provenance.", negative="")] = False,
    json: Json = False,
    plot: Plot = None,
) -> None:
    """Simulate a rig and say what it did.

    Parameters
    ----------
    rig
        A rig file in TOML, or with --again a run that `simulate` wrote.
    """
    from stickslip import measure, store
    from stickslip import rig as rigs
    from stickslip.simulate import repeat
    from stickslip.simulate import simulate as run_case

    _check_target(plot)
    _check_target(output)
    with _bar("simulating") as progress:
        if again:
            run = repeat(before := store.load(rig), progress=progress)
            run.attrs.update({key: value for key, value in before.attrs.items() if key not in run.attrs})
        else:
            described = rigs.read(rig)
            run = run_case(
                described.interface,
                described.slider,
                described.drive,
                described.method,
                record=described.record,
                start=described.start,
                progress=progress,
            )
            run.attrs["rig"] = rigs.to_toml(described)
    if output is not None:
        store.save(run, output)
    shown = _in_its_units(run)
    seen = measure.regime(shown)
    if plot is not None:
        from stickslip import plot as drawing

        drawing.save(drawing.overview(shown), plot)
    if json:
        _print_json({"regime": _plain(seen), "output": str(output) if output else None})
        return
    print(seen)
    for what, where in (("run", output), ("picture", plot)):
        if where is not None:
            print(f"{what}: {where}")


@app.command
def measure(
    data: Path,
    *,
    force: Annotated[str | None, Parameter(help="Column of the force, by name or number from 1.")] = None,
    time: Annotated[str | None, Parameter(help="Column of the time, by name or number from 1.")] = None,
    step: Annotated[float | None, Parameter(help="Seconds from one row to the next, where there is no time.")] = None,
    displacement: Annotated[str | None, Parameter(help="Column of the displacement, by name or number.")] = None,
    load: Annotated[str | None, Parameter(help="Column of the normal load, or the load itself: '20 N'.")] = None,
    flip: Annotated[bool, Parameter(help="Change the sign of the force.", negative="")] = False,
    minimum_drop: Annotated[float | None, Parameter(help="Smallest drop that counts as a slip.")] = None,
    after: Annotated[float | None, Parameter(help="Look at what comes after this time only.")] = None,
    events: Annotated[Path | None, Parameter(help="Write the catalogue of slips as CSV.")] = None,
    json: Json = False,
    plot: Plot = None,
) -> None:
    """Tell the regime and list the slips of a run or of a measured force trace.

    Parameters
    ----------
    data
        A run (NetCDF), or a table in plain text with a column of force.
    """
    from stickslip import measure as measures
    from stickslip import store

    _check_target(plot)
    _check_target(events)
    trace = _read_data(data, force, time, step, displacement=displacement, load=load, flip=flip)
    catalogue = measures.drops(trace, minimum_drop=minimum_drop, after=after)
    seen = measures.regime(trace, after=after)
    if events is not None:
        with store.whole_file(events, example="slips.csv") as part:
            part.write_text(_as_csv(catalogue))
    if plot is not None:
        from stickslip import plot as drawing

        drawing.save(drawing.overview(trace, events=catalogue), plot)
    unreadable = jsonlib.loads(trace.attrs.get("unreadable", "[]"))
    if json:
        _print_json(
            {
                "regime": _plain(seen),
                "statistics": {
                    str(name): {key: _plain(column.attrs[key]) for key in ("mean", "std", "units")}
                    for name, column in catalogue.data_vars.items()
                    if "mean" in column.attrs
                }
                | {"count": catalogue.attrs["count"]},
                "events": {str(name): _plain(catalogue[name].to_numpy()) for name in catalogue.variables},
                "unreadable": unreadable,
            }
        )
        return
    print(seen)
    print()
    print(f"{catalogue.attrs['count']} slips; mean ± standard deviation:")
    for name, text in measures.statistics(catalogue):
        print(f"{name}: {text}")
    if note := trace.attrs.get("note"):
        print(f"note: {note}")
    for what, where in (("slips", events), ("picture", plot)):
        if where is not None:
            print(f"{what}: {where}")


@app.command
def plot(
    data: Path,
    output: Path,
    *,
    kind: Literal["overview", "phase", "stretchings", "energy"] = "overview",
    force: str | None = None,
    time: str | None = None,
    step: float | None = None,
    at: Annotated[str | None, Parameter(help="Of a sweep, the cut to draw: delay=0.1,start=cold.")] = None,
    bistable: Annotated[bool, Parameter(help="Of a sweep: show where stick-slip dies, too.", negative="")] = False,
) -> None:
    """Draw a run, a measured trace or a sweep.

    Parameters
    ----------
    data
        A run (NetCDF), a table in plain text, or the store of a sweep.
    output
        The picture: .png, .svg or .pdf.
    kind
        What to draw of a run.
    """
    from stickslip import plot as drawing

    _check_target(output)
    if data.is_dir():
        theory = _draw_sweep(_cut(_open_sweep(data), at), output, bistable=bistable)
        print(f"on top: {theory}\npicture: {output}")
        return
    trace = _read_data(data, force, time, step)
    if kind == "overview":
        figure: Any = drawing.overview(trace)
    else:
        draw = {"phase": drawing.phase_portrait, "stretchings": drawing.stretchings, "energy": drawing.energy}[kind]
        figure = draw(trace).get_figure(root=True)
    drawing.save(figure, output)
    print(f"picture: {output}")


@app.command
def map(
    rig: Path,
    *,
    over: Annotated[str, Parameter(help="Two knobs, such as stiffness,velocity.")] = "stiffness,velocity",
    around: Annotated[float, Parameter(help="Factor on either side of the rig's own point.")] = 30.0,
    points: Annotated[int, Parameter(help="Points of the map along each knob.")] = 80,
    bistable: Annotated[bool, Parameter(help="Show where stick-slip lasts beside it, too.", negative="")] = False,
    output: Annotated[Path, Parameter(alias="-o", help="The picture.")] = Path("map.png"),
    json: Json = False,
) -> None:
    """Draw where smooth sliding is stable, over two knobs of a rig; computed, not swept.

    Parameters
    ----------
    rig
        A rig file in TOML.
    """
    from stickslip import advise
    from stickslip import plot as drawing
    from stickslip import rig as rigs

    _check_target(output)
    names = tuple(part.strip() for part in over.split(","))
    if len(names) != 2:
        raise InputError(f"--over {over}: must name two knobs with a comma between, such as stiffness,velocity")
    described = rigs.read(rig)
    with _bar("mapping") as progress:
        found = advise.chart(described, (names[0], names[1]), around, points, bistable=bistable, progress=progress)
    drawing.save(drawing.chart(found), output)
    if json:
        _print_json({str(name): _plain(found[name].to_numpy()) for name in found.variables} | _plain(dict(found.attrs)))
        return
    print(found.attrs["summary"])
    print(f"picture: {output}")


@app.command
def sweep(
    file: Path,
    *,
    store: Annotated[Path, Parameter(help="Directory of the results; if it is there, the sweep goes on.")],
    workers: Annotated[int | None, Parameter(help="Cases that run at a time; by default one per core.")] = None,
    processes: Annotated[bool, Parameter(help="Run them in processes, not in threads.", negative="")] = False,
    scheduler: Annotated[str | None, Parameter(help="Run them on a Dask cluster: tcp://HOST:PORT.")] = None,
    retry_failed: Annotated[bool, Parameter(help="Run cases again that failed before.", negative="")] = False,
    replot: Annotated[bool, Parameter(help="Run nothing: draw what the store holds.", negative="")] = False,
    bistable: Annotated[bool, Parameter(help="Draw where stick-slip dies, too; takes seconds.", negative="")] = False,
    json: Json = False,
    plot: Plot = None,
) -> int:
    """Run many cases over the knobs of a rig; a second start with the same store runs what is missing.

    The exit code is 1 if cases failed: they are recorded, and the others are done.

    Parameters
    ----------
    file
        A sweep file in TOML; see examples/phase_diagram.toml.
    """
    from stickslip.sweep import plan as plans

    _check_target(plot)
    plan = plans.read_plan(file)
    if replot and plot is None:
        raise InputError("--replot: needs --plot FILE, the picture to draw")
    if replot:
        result = _open_sweep(store)
        if not plans.plan_of(result).is_same(plan):
            raise InputError(f"store = {str(store)!r}: holds another sweep than {file}; draw it with `stickslip plot`")
    else:
        with _executor(workers, processes, scheduler) as executor, _bar(plan.name) as report, _stoppable():
            try:
                result = plan.run(
                    store=store,
                    executor=executor,
                    progress=lambda p: report(p.finished / p.total),
                    retry_failed=retry_failed,
                )
            except KeyboardInterrupt:
                return _fail(f"interrupted; {_resume(store)}", code=130)
    theory = None if plot is None else _draw_sweep(result, plot, bistable=bistable)
    return _report_sweep(result, store, plot, theory, json=json)


@app.command
def paper(
    figure: str,
    *,
    check: Annotated[bool, Parameter(help="Check the paper's claims; exit code 1 if one fails.", negative="")] = False,
    quick: Annotated[bool, Parameter(help="Fewer points and contacts.", negative="")] = False,
    directory: Annotated[Path, Parameter(alias="-d", help="Where picture and data go.")] = Path(),
    json: Json = False,
) -> int:
    """Make a figure of the paper: picture, data and, with --check, its claims with verdicts.

    Parameters
    ----------
    figure
        fig1, fig2 ...
    """
    from stickslip import plot as drawing
    from stickslip import store
    from stickslip.paper import FIGURES

    if figure not in FIGURES:
        raise InputError(f"{figure}: no such figure; there are {', '.join(FIGURES)}")
    if not directory.is_dir():
        raise InputError(f"--directory {directory}: no such directory")
    chosen = FIGURES[figure]
    with _bar(figure) as progress:
        data = chosen.compute(progress=progress, quick=quick)
    picture = drawing.save(chosen.draw(data), directory / f"{figure}.png")
    file = store.save(data, directory / f"{figure}.nc")
    claims = chosen.check(data) if check else ()
    failed = [claim for claim in claims if not claim.ok]
    if json:
        _print_json(
            {
                "picture": str(picture),
                "data": str(file),
                "claims": [claim.plain() for claim in claims],
                "ok": not failed,
            }
        )
        return 1 if failed else 0
    for claim in claims:
        print(claim)
        print()
    print(f"picture: {picture}\ndata: {file}")
    if failed:
        print(f"{len(failed)} of {len(claims)} claims did not come out as settled", file=sys.stderr)
    return 1 if failed else 0


@app.command
def explore(
    rig: Path | None = None,
    *,
    port: Annotated[int | None, Parameter(help="Port on this machine; 0 for any free one.")] = None,
    browser: Annotated[bool, Parameter(help="Open the page in the browser.")] = True,
) -> None:
    """Open the browser app: move a slider and see sliding turn into stick-slip.

    Parameters
    ----------
    rig
        A rig file in TOML to begin with.
    """
    from stickslip import explorer

    def ready(address: str) -> None:
        print(f"stickslip explorer: {address} (stop it with Ctrl-C)", flush=True)
        if browser:
            import webbrowser

            webbrowser.open(address)

    explorer.serve(rig, port=port, ready=ready)


# ---------------------------------------------------------------------------------------------------------------------
# What they share
# ---------------------------------------------------------------------------------------------------------------------


@contextmanager
def _bar(title: str) -> Iterator[Callable[[float], None]]:
    """A progress bar on a terminal, nothing in a pipe."""
    if not sys.stderr.isatty():
        yield lambda _share: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=1.0)
        yield lambda share: bar.update(task, completed=share)


@contextmanager
def _executor(workers: int | None, processes: bool, scheduler: str | None) -> Iterator[Any]:
    """Where the cases of a sweep run."""
    from stickslip.sweep import Processes, Threads

    if scheduler is None:
        yield Processes(workers) if processes else Threads(workers)
        return
    if processes or workers is not None:
        raise InputError("--scheduler: the cluster has its own workers; leave out --workers and --processes")
    with _dask(scheduler) as client:
        if not client.nthreads():
            print(f"no workers yet; start one with: dask worker {scheduler}", file=sys.stderr)
        yield client.get_executor()


@contextmanager
def _stoppable() -> Iterator[None]:
    """Take the signal that a cluster sends before it kills for a Ctrl-C: what is done is written down first."""
    import signal
    import threading

    if threading.current_thread() is not threading.main_thread():  # only that one may
        yield
        return

    def stop(_number: int, _frame: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextmanager
def _dask(scheduler: str) -> Iterator[Any]:
    import logging

    try:
        from distributed import Client
    except ImportError:
        raise InputError("--scheduler needs the dask.distributed package: pip install stickslip[sweep]") from None
    for name in [*logging.root.manager.loggerDict]:
        if name.startswith("distributed"):
            logging.getLogger(name).setLevel(logging.CRITICAL)  # what concerns the user is said in our line
    try:
        client: Any = Client(scheduler, timeout=_PATIENCE, set_as_default=False)  # type: ignore[no-untyped-call]
    except (OSError, ValueError, TimeoutError) as error:
        reason = " ".join(str(error).split())
        raise InputError(
            f"--scheduler {scheduler}: cannot be reached ({reason}); start one with: dask scheduler"
        ) from None
    try:
        yield client
    finally:
        client.close(timeout=5)


def _open_sweep(store: Path) -> xr.Dataset:
    from stickslip.sweep import open_sweep
    from stickslip.sweep import plan as plans

    return plans.open_refined(store) if plans.is_refined(store) else open_sweep(store)


def _cut(result: xr.Dataset, at: str | None) -> xr.Dataset:
    """Select from a sweep, each axis at the value nearest to the one given."""
    for part in (at or "").split(",") if at else ():
        name, _, value = (word.strip() for word in part.partition("="))
        if name not in result.dims or not value:
            axes = ", ".join(str(dim) for dim in result.dims)
            raise InputError(f"--at {part}: must be an axis and a value, as in delay=0.1; this sweep has {axes}")
        numbers = result[name].dtype.kind in "iuf"
        try:
            result = result.sel({name: float(value)}, method="nearest") if numbers else result.sel({name: value})
        except (KeyError, ValueError):
            there = ", ".join(str(item) for item in result[name].values.tolist())
            raise InputError(f"--at {part}: no such value; this sweep has {there}") from None
    return result


def _draw_sweep(result: xr.Dataset, picture: Path, *, bistable: bool) -> str:
    """Draw a sweep with what theory says on top; return what that is, or why there is nothing."""
    from stickslip import plot as drawing
    from stickslip.sweep import plan as plans

    with _bar("drawing") as progress:
        result = plans.with_theory(result, bistable=bistable, progress=progress)
    drawing.save(drawing.sweep_picture(result), picture)
    return str(result.attrs["theory"])


def _resume(store: Path) -> str:
    """What is kept, and how to go on."""
    from stickslip.sweep import open_sweep, summary

    try:
        kept = f"{summary(open_sweep(store))} are kept in {str(store)!r}"
    except InputError:  # it had not begun, or is a refinement
        kept = f"what was done is kept in {str(store)!r}" if store.exists() else "nothing was done yet"
    return f"{kept}; the same command goes on from there"


def _report_sweep(result: xr.Dataset, store: Path, picture: Path | None, theory: str | None, *, json: bool) -> int:
    """Say what became of the cases; the last line and the exit code say whether some failed."""
    from stickslip.sweep import plan as plans

    report = plans.report(result)
    if json:
        _print_json(
            _plain(report) | {"store": str(store), "picture": str(picture) if picture else None, "theory": theory}
        )
        return 1 if report.failures else 0
    for kind, count in report.regimes.items():
        print(f"{kind}: {count}")
    print(f"store: {store}")
    if picture is not None:
        print(f"picture: {picture}, on top: {theory}")
    for failure in report.failures[:_FAILURES_SHOWN]:
        print(f"failed: {failure}")
    if len(report.failures) > _FAILURES_SHOWN:
        print(f"failed: ... and {len(report.failures) - _FAILURES_SHOWN} more, in the variable error of the store")
    print(report.line)
    return 1 if report.failures else 0


_FAILURES_SHOWN = 5
_PATIENCE = "10s"
"""How long a scheduler is waited for."""


def _check_target(path: Path | None) -> None:
    """Complain of a place that cannot be written before any work is done."""
    if path is None:
        return
    if path.is_dir():
        raise InputError(f"{path}: is a directory; give the name of a file")
    if not path.absolute().parent.is_dir():
        raise InputError(f"{path}: there is no directory {path.parent}; make it first")


def _read_data(
    data: Path,
    force: str | None,
    time: str | None,
    step: float | None,
    *,
    displacement: str | None = None,
    load: str | None = None,
    flip: bool = False,
) -> xr.Dataset:
    """Read a run, in its units, or a measured trace."""
    from stickslip import measure as measures
    from stickslip import store

    if data.is_file() and store.is_netcdf(data):
        run = store.load(data)
        if "F_d" not in run or "t" not in run.coords:
            raise InputError(f"{data}: holds no run: there is no force F_d along a time t in it")
        return _in_its_units(run)
    return measures.read_trace(data, force=force, time=time, displacement=displacement, load=load, step=step, flip=flip)


def _in_its_units(run: xr.Dataset) -> xr.Dataset:
    """A run in the units of the rig file that it was made from."""
    from stickslip import rig as rigs

    if "rig" not in run.attrs:
        return run
    import tomllib

    return rigs.from_document(tomllib.loads(run.attrs["rig"]), "the rig in this run").in_its_units(run)


def _as_csv(catalogue: xr.Dataset) -> str:
    import csv
    import io

    text = io.StringIO()
    writer = csv.writer(text)
    names = [str(name) for name in catalogue.data_vars]
    writer.writerow([f"{name} [{catalogue[name].attrs.get('units', '')}]" for name in names])
    writer.writerows(zip(*(catalogue[name].to_numpy().tolist() for name in names), strict=True))
    return text.getvalue()


def _plain(value: Any) -> Any:
    """Turn a result into what JSON can hold; what is not finite becomes null."""
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: _plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, complex):
        return {"real": _plain(value.real), "imag": _plain(value.imag)}
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, (bool, int, str)):
        return value
    return str(value)


def _print_json(value: Any) -> None:
    print(jsonlib.dumps(value, indent=2))


def _prediction_as_plain(found: Prediction, rig: Rig) -> dict[str, Any]:
    keep = {
        field.name: _plain(getattr(found, field.name)) for field in fields(found) if field.name not in ("rig", "run")
    }
    scales = None if rig.scales is None else _plain(rig.scales)
    return {
        "rig": rig.name,
        "units": "natural, per contact; multiply by the scales for SI; each regime names its own",
        "scales": scales,
        "velocity": rig.velocity,
        "stiffness": rig.slider.stiffness,
        "stiffness_margin": _plain(found.stiffness_margin),
        "smooth": found.smooth,
        "bistable": found.bistable,
        "verdict": found.verdict,
        **keep,
        "assumed": dict(rig.assumed),
    }


def _print_prediction(found: Prediction, rig: Rig, picture: Path | None) -> None:
    from rich.console import Console
    from rich.table import Table

    # In a pipe nobody knows the width of the page: keep the lines of a table whole.
    console = Console(highlight=False, soft_wrap=True, width=None if sys.stdout.isatty() else 140)
    console.print(f"[bold]{rig.name}[/bold]: {found.verdict}\n")
    console.print(str(found.regime) + "\n", markup=False)
    numbers = Table(box=None, show_header=False, pad_edge=False)
    for name, text in found.numbers():
        numbers.add_row(name, text)
    console.print(numbers)
    if found.margins:
        console.print("\n[bold]Margins[/bold] of smooth sliding, each knob turned alone (linear stability)")
        table = Table(box=None, pad_edge=False)
        for title in ("knob", "now", "nearest edge below", "nearest edge above"):
            table.add_column(title)
        for row in found.margin_rows():
            table.add_row(*row)
        console.print(table)
    if found.remedies:
        console.print("\n[bold]Remedies[/bold], one change at a time, the smallest first")
        for line in found.remedy_lines():
            console.print(f"- {line}", markup=False)
    elif found.ill:
        console.print("\nNo single change within the ranges searched gives smooth sliding.")
    if rig.assumed:
        console.print("\n[bold]Assumed[/bold], not measured:")
        for key, how in rig.assumed.items():
            console.print(f"- {key}: {how}", markup=False)
    if picture is not None:
        console.print(f"\npicture: {picture}", markup=False)


if __name__ == "__main__":
    sys.exit(main())
