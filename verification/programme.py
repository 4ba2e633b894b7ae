"""Run studies in parallel, and keep their findings."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context

from verification import STUDIES
from verification.report import Outcome


def run_all(
    names: Sequence[str], workers: int, step: Callable[[Outcome], None]
) -> list[Outcome]:
    """Run studies in processes of their own; `step` is called as each ends. The order
    of the results is that of the names.
    """
    done: dict[str, Outcome] = {}
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        waiting = {pool.submit(run_one, name): name for name in names}
        try:
            for future in as_completed(waiting):
                name = waiting[future]
                try:
                    done[name] = future.result()
                except Exception as error:  # the process itself died
                    done[name] = Outcome(
                        study=name, findings=(), seconds=0.0, failure=repr(error)
                    )
                step(done[name])
        finally:
            pool.shutdown(cancel_futures=True)  # or an error here would wait for all
    return [done[name] for name in names]


def run_one(name: str) -> Outcome:
    """Run one study; an exception becomes a finding and does not end the programme."""
    begun = time.perf_counter()
    try:
        findings, failure = STUDIES[name].run(), ""
    except Exception:
        findings = ()
        failure = traceback.format_exc()
    return Outcome(
        study=name,
        findings=findings,
        seconds=time.perf_counter() - begun,
        failure=failure,
    )
