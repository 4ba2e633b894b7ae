"""10,000 cases of about 1 ms on two cores: how busy the cores are, and what the sweep
itself costs.

Cases that do nothing give the cost of the sweep on any machine: all CPU time is then
its own. Wall time and the fraction of two cores are printed as measured. If other
programs run too, the fraction of what they leave says more: CPU time of the cases over
the sum of that time, CPU time of the sweep itself, and the time that the cores idled.
Processes are started and have compiled before the clock starts; their start (about 1 s
of CPU each) is printed separately.
"""

import functools
import multiprocessing
import os
import resource
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

# worker processes import the case by name
sys.path.insert(0, str(Path(__file__).parent))

import sweep_spin

import stickslip as ss
from stickslip.paper.cases import FIG4
from stickslip.sweep import NamedStudy, Processes, Runs, Threads, run_study, summary

CASES = 10_000
SECONDS = 1e-3
CORES = 2
RUNS = 1_000  # of a rig, some 10 ms each
TICK = os.sysconf("SC_CLK_TCK")


@contextmanager
def threads():
    yield Threads(CORES), lambda: 0.0


@contextmanager
def processes():
    context = multiprocessing.get_context("spawn")
    begin = time.perf_counter()
    with ProcessPoolExecutor(CORES, mp_context=context) as pool:
        list(pool.map(sweep_spin.warm, [0.3] * CORES))
        print(
            f"\nstart of {CORES} processes {time.perf_counter() - begin:.2f} s", end=""
        )
        children = [process.pid for process in multiprocessing.active_children()]
        yield pool, lambda: sum(map(cpu_of, children))


def cpu_of(pid):
    """Return the CPU time of another process, in seconds."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICK


def cpu_here():
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def idle():
    """Return the seconds that the cores available to this process have idled."""
    cores = {f"cpu{i}" for i in os.sched_getaffinity(0)}
    lines = [line.split() for line in Path("/proc/stat").read_text().splitlines()]
    return sum(int(line[4]) + int(line[5]) for line in lines if line[0] in cores) / TICK


@pytest.mark.parametrize("pool", [threads, processes])
@pytest.mark.parametrize("stored", [False, True], ids=["memory", "store"])
def test_ten_thousand_cases_of_a_millisecond(benchmark, tmp_path, pool, stored):
    case = functools.partial(sweep_spin.case, steps=sweep_spin.steps_for(SECONDS))
    study = NamedStudy(run=case, name="spin", version="1")
    figures = {}

    def run(executor, others):
        store = tmp_path / "bench.sqlite" if stored else None
        begin = time.perf_counter(), cpu_here() + others(), idle()
        result = run_study(
            study, {"i": np.arange(CASES)}, executor=executor, store=store
        )
        end = time.perf_counter(), cpu_here() + others(), idle()
        wall, cpu, idled = (b - a for a, b in zip(begin, end, strict=True))
        busy = float(result["busy"].sum())
        figures.update(
            wall_s=wall,
            case_ms=1e3 * busy / CASES,
            share_of_two_cores=busy / (CORES * wall),
            left_by_others=(cpu + idled) / (CORES * wall),
            share_of_what_others_left=busy / (cpu + idled),
            overhead_us_per_case=1e6 * (cpu - busy) / CASES,
            overhead_percent=100 * (cpu - busy) / busy,
        )
        return result

    with pool() as (executor, others):
        # Imports (xarray) and the first use of the executor are paid once, not per
        # case.
        run_study(
            study, {"i": range(4)}, executor=executor, store=tmp_path / "warm.sqlite"
        )
        result = benchmark.pedantic(
            run, args=(executor, others), rounds=1, iterations=1
        )
    assert summary(result).done == CASES
    np.testing.assert_array_equal(result["twice"], 2 * np.arange(CASES))
    benchmark.extra_info.update(figures)
    print("\n" + "  ".join(f"{name} {value:.3g}" for name, value in figures.items()))
    # on a crowded machine this would measure caches and task switches, not the sweep
    if figures["left_by_others"] > 0.8:
        assert figures["share_of_two_cores"] > 0.85 * figures["left_by_others"]


def nothing(i, seed):
    return {"twice": 2 * i, "seed": float(seed), "half": 0.5 * i}


NOTHING = NamedStudy(run=nothing, name="nothing", version="1")


@pytest.mark.parametrize("stored", [False, True], ids=["memory", "store"])
def test_what_a_sweep_costs_without_its_cases(benchmark, tmp_path, stored):
    run_study(NOTHING, {"i": range(4)}, store=tmp_path / "warm.sqlite")
    costs = []

    def run(round_):
        begin = time.process_time()
        store = tmp_path / f"{round_}.sqlite" if stored else None
        result = run_study(NOTHING, {"i": np.arange(CASES)}, store=store)
        costs.append(1e6 * (time.process_time() - begin) / CASES)
        return result

    rounds = iter(range(100))
    result = benchmark.pedantic(
        run, setup=lambda: ((next(rounds),), {}), rounds=5, iterations=1
    )
    assert summary(result).done == CASES
    benchmark.extra_info.update(
        cpu_us_per_case=min(costs), percent_of_a_millisecond=min(costs) / 10
    )
    print(
        f"\ncpu_us_per_case {min(costs):.3g} (5 rounds: "
        f"{', '.join(f'{cost:.3g}' for cost in costs)})"
    )
    assert min(costs) < 1e6 * 0.05 * SECONDS  # less than 5 % of a case of 1 ms


# ---------------------------------------------------------------- runs of a rig


def everywhere():
    """CPU time of this process and of its workers: it does not depend on what others
    leave of the cores.
    """
    return cpu_here() + sum(
        cpu_of(process.pid) for process in multiprocessing.active_children()
    )


SHORT = FIG4.rig.replace(drive=ss.constant(1.0, 6.0), method=ss.Contacts(1_000))


def looped(seeds):
    return [
        ss.regime(ss.simulate(SHORT, method=ss.Contacts(1_000, seed=seed))).kind
        for seed in seeds
    ]


def swept(seeds, executor):
    return ss.sweep(
        SHORT,
        {"seed": list(seeds)},
        runs=Runs(distance=6.0, cycles=0, extensions=0),
        executor=executor,
    )


@pytest.mark.benchmark(timer=everywhere, group="a thousand short runs, each classified")
def test_a_loop_of_short_runs(benchmark):
    benchmark.extra_info.update(role="plain")
    benchmark.pedantic(looped, (range(RUNS),), rounds=1, warmup_rounds=1)


@pytest.mark.benchmark(timer=everywhere, group="a thousand short runs, each classified")
@pytest.mark.parametrize("cores", [1, CORES])
def test_a_sweep_of_short_runs(benchmark, cores):
    """On each core, at least 80 % of the runs per second of a plain loop."""
    benchmark.extra_info.update(
        role="cost",
        what=f"as a sweep on {cores} core{'s' * (cores > 1)}",
        promised=1.25,
    )
    executor = Threads(1) if cores == 1 else Processes(cores)
    with executor:
        # workers start, and load their modules
        swept(range(RUNS, RUNS + 8 * cores), executor)
        found = benchmark.pedantic(swept, (range(RUNS), executor), rounds=1)
    assert summary(found).done == RUNS
