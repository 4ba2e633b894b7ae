"""Run the verification programme: `python -m verification --help`."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

from cyclopts import App, CycloptsError, Parameter

from stickslip.errors import InputError
from verification import STUDIES
from verification.programme import run_all
from verification.report import Outcome, read, save, stale

app = App(
    name="verification",
    help="The verification programme, with one report.",
    result_action="return_value",
)


@app.default
def run(
    *names: str,
    report: Annotated[
        Path, Parameter(help="Folder for report.json and report.html.")
    ] = Path(),
    workers: Annotated[int, Parameter(help="Studies at a time.")] = 2,
    only_stale: Annotated[
        bool,
        Parameter(
            name="--stale",
            help="Leave out the studies that the report has of these sources.",
            negative="",
        ),
    ] = False,
    listing: Annotated[
        bool, Parameter(name="--list", help="List the studies and stop.", negative="")
    ] = False,
) -> int:
    """Run all studies, or those named; the exit code is 1 if one does not have its
    reference verdicts.

    Each study is written into the report as it ends and replaces its earlier result;
    the others stay.

    Parameters
    ----------
    names
        Studies or whole groups, such as fig4 or "closed forms".
    """
    if listing:
        for study in STUDIES.values():
            print(f"{study.name:16} {study.group}: {study.title}")
        return 0
    if workers < 1:
        raise InputError(f"--workers {workers}: must be at least 1")
    kept = read(report)
    chosen = [name for name in _chosen(names) if not only_stale or name in stale(kept)]
    with _bar(len(chosen)) as step:

        def keep(outcome: Outcome) -> None:
            kept[outcome.study] = outcome.plain()
            save(kept, report)
            step(outcome)

        outcomes = run_all(chosen, workers, keep)
    data, page = save(kept, report)
    for outcome in outcomes:
        for claim in outcome.findings:
            if not claim.ok:
                print(f"\n{outcome.study}: {claim}")
        if outcome.failure:
            print(f"\n{outcome.study}: could not be finished\n{outcome.failure}")
    bad = [name for name, study in kept.items() if not study["ok"]]
    print(
        (
            f"\n{len(kept) - len(bad)} of {len(kept)} studies in the report came out "
            "as "
            "settled"
        )
        + (f"; not {', '.join(bad)}" if bad else "")
    )
    print(f"report: {page}\ndata: {data}")
    return 1 if bad else 0


def _chosen(names: Sequence[str]) -> list[str]:
    """Return names of studies, with groups expanded; all of them if none is named."""
    groups = {
        study.group.lower(): [
            s.name for s in STUDIES.values() if s.group == study.group
        ]
        for study in STUDIES.values()
    }
    chosen: list[str] = []
    for name in names:
        if name not in STUDIES and name.lower() not in groups:
            raise InputError(
                f"{name}: no such study; there are {', '.join(STUDIES)}; or a group: "
                f"{', '.join(groups)}"
            )
        chosen += [name] if name in STUDIES else groups[name.lower()]
    return list(dict.fromkeys(chosen)) or list(STUDIES)


@contextmanager
def _bar(total: int) -> Iterator[Callable[[Outcome], None]]:
    """Print a line for each study as it ends, above a progress bar if on a terminal."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
    )

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    with Progress(
        *columns, console=Console(highlight=False, soft_wrap=True), transient=True
    ) as bar:
        task = bar.add_task("verifying", total=total)

        def step(outcome: Outcome) -> None:
            state = "ok    " if outcome.ok else "FAILED"
            bar.console.print(
                (
                    f"{state} {outcome.study:16} {outcome.seconds:6.1f} s  "
                    f"{STUDIES[outcome.study].title}"
                ),
                markup=False,
            )
            bar.advance(task)

        yield step


def main() -> int:
    """Run the command line; return the exit code."""
    try:
        result = app(sys.argv[1:], exit_on_error=False, print_error=False)
    except (InputError, CycloptsError) as error:
        print("verification: " + " ".join(str(error).split()), file=sys.stderr)
        return 2
    return result if isinstance(result, int) else 0


if __name__ == "__main__":
    sys.exit(main())
