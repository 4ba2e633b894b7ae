"""Turn the results of `make bench` into tables of ratios, and write them into pages;
return 1 if a promise is broken.

Usage: python tools/bench_table.py BENCHMARK.json [PAGE.md ...]
"""

from __future__ import annotations

import json
import re
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

NOT_MET = "**not met**"


def tables(record: dict[str, Any]) -> dict[str, str]:
    """Return two tables: fast paths compared with the plain loops of their groups, and
    the costs of runs, by name.

    A benchmark has a `role`: "plain" is the reference of its group, "fast" is
    `promised` times as quick at least, "cost" `promised` times as long at most.
    """
    plain = {
        item["group"]: item
        for item in record["benchmarks"]
        if item["extra_info"].get("role") == "plain"
    }
    beside = {"fast": "plain loop", "cost": "beside"}
    lines = {
        role: [f"| what | {name} | time | ratio | promised |", "|---|---|---|---|---|"]
        for role, name in beside.items()
    }
    for item in record["benchmarks"]:
        info = item["extra_info"]
        if (role := info.get("role")) not in lines:
            continue
        reference = _least(plain[item["group"]])
        here = _least(item)
        ratio, bound = (
            (reference / here, "at least")
            if role == "fast"
            else (here / reference, "at most")
        )
        kept = (
            ratio >= info["promised"] if role == "fast" else ratio <= info["promised"]
        )
        lines[role].append(
            f"| {item['group']}: {info['what']} | {seconds(reference)} | "
            f"{seconds(here)} | {ratio:.3g} "
            f"| {bound} {info['promised']}{'' if kept else ', ' + NOT_MET} |"
        )
    when = datetime.fromisoformat(record["datetime"]).astimezone(UTC).date()
    cpu = record["machine_info"]["cpu"].get("brand_raw", "unknown processor")
    made = (
        f"Minimum of each, in one run on {when}; {cpu}, Python "
        f"{record['machine_info']['python_version']}."
    )
    return {
        role: "\n".join([*rows, "", made]) for role, rows in lines.items() if rows[2:]
    }


def _least(item: dict[str, Any]) -> float:
    info = item["extra_info"]
    return float(
        (item["stats"]["min"] - info.get("start", 0.0)) * info.get("scale", 1.0)
    )


def seconds(value: float) -> str:
    """Return a time as text with a unit, to three digits."""
    unit, name = next(
        (pair for pair in ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs")) if value >= pair[0]),
        (1e-9, "ns"),
    )
    return f"{value / unit:.3g} {name}"


def insert(text: str, role: str, found: str) -> str:
    """Return a page with a table between its two marks."""
    begin = f"<!-- {role}:begin -->"
    end = f"<!-- {role}:end -->"
    pattern = re.compile(f"{re.escape(begin)}.*?{re.escape(end)}", re.DOTALL)
    return pattern.sub(lambda _: f"{begin}\n{found}\n{end}", text)


def main(arguments: list[str]) -> int:
    """Print the tables; write them into the named pages that have marks for them."""
    if not arguments:
        print(__doc__, file=sys.stderr)
        return 2
    found = tables(json.loads(Path(arguments[0]).read_text()))
    print(*found.values(), sep="\n\n")
    for page in map(Path, arguments[1:]):
        for role, table in found.items():
            page.write_text(insert(page.read_text(), role, table))
    return 1 if any(NOT_MET in table for table in found.values()) else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
