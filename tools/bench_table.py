"""Turn the record of `make bench` into one table of ratios, and put it into the README; 1 if a promise is broken.

Usage: python tools/bench_table.py BENCHMARK.json [README.md]
"""

from __future__ import annotations

import json
import re
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

BEGIN, END = "<!-- benchmarks:begin -->", "<!-- benchmarks:end -->"
NOT_MET = "**not met**"


def table(record: dict[str, Any]) -> str:
    """Return the table of all groups that have a plain loop and a fast path."""
    groups: dict[str, dict[str, Any]] = {}
    for item in record["benchmarks"]:
        role = item["extra_info"].get("role")
        if role is not None:
            groups.setdefault(item["group"], {})[role] = item
    lines = ["| what | plain loop | fast path | ratio | promised |", "|---|---|---|---|---|"]
    for name, pair in groups.items():
        if set(pair) != {"plain", "fast"}:
            continue
        plain = pair["plain"]["stats"]["min"] * pair["plain"]["extra_info"].get("scale", 1.0)
        fast = pair["fast"]["stats"]["min"]
        info = pair["fast"]["extra_info"]
        kept = "" if plain / fast >= info["promised"] else f", {NOT_MET}"
        lines.append(
            f"| {name}: {info['what']} | {seconds(plain)} | {seconds(fast)} "
            f"| {plain / fast:.3g} | at least {info['promised']}{kept} |"
        )
    when = datetime.fromisoformat(record["datetime"]).astimezone(UTC).date()
    cpu = record["machine_info"]["cpu"].get("brand_raw", "unknown processor")
    lines += ["", f"Minimum of each, in one run on {when}; {cpu}, Python {record['machine_info']['python_version']}."]
    return "\n".join(lines)


def seconds(value: float) -> str:
    """Return a time in words, with three digits."""
    return f"{value:.3g} s" if value >= 1 else f"{1e3 * value:.3g} ms"


def insert(text: str, found: str) -> str:
    """Return a page with the table between its two marks."""
    pattern = re.compile(f"{re.escape(BEGIN)}.*?{re.escape(END)}", re.DOTALL)
    return pattern.sub(lambda _: f"{BEGIN}\n{found}\n{END}", text)


def main(arguments: list[str]) -> int:
    """Print the table; write it into the page named, if any."""
    if not arguments:
        print(__doc__, file=sys.stderr)
        return 2
    found = table(json.loads(Path(arguments[0]).read_text()))
    print(found)
    for name in arguments[1:]:
        page = Path(name)
        page.write_text(insert(page.read_text(), found))
    return 1 if NOT_MET in found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
