"""What the pages hold that is made from the code: commands, keys of a rig file,
claims; and MathJax from its wheel.
"""

from __future__ import annotations

import importlib
import importlib.metadata
import json
import re
import shutil
import sys
import tomllib
from pathlib import Path
from typing import Any
from unittest import mock

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.util.logging import getLogger

logger = getLogger(__name__)

ROOT = Path(__file__).parents[2]
REPORT = ROOT / "verification" / "report.json"


class _Made(SphinxDirective):
    """A directive whose content is Markdown that a function writes."""

    def text(self) -> str:
        raise NotImplementedError

    def run(self) -> list[nodes.Node]:
        return self.parse_text_to_nodes(self.text(), allow_section_headings=True)


# ---------------------------------------------------------------- commands


def commands() -> str:
    """Every command with its options, from the command line's own help."""
    from stickslip.cli import app

    # usage lines begin with the program that runs
    with mock.patch.object(sys, "argv", ["stickslip"]):
        pages = app.generate_docs(output_format="markdown")
    # From the first command on; what precedes lists them once more.
    body = pages[pages.index("\n## stickslip ") :]
    # Options in running text keep their dashes; one without help ends in a colon.
    body = re.sub(
        r"(`[^`\n]*`)|(?<!\S)(--[a-z][\w-]*)",
        lambda found: found[1] or f"`{found[2]}`",
        body,
    )
    return re.sub(r":\s*$", "", body, flags=re.MULTILINE)


class Commands(_Made):
    """``{commands}``"""

    def text(self) -> str:
        return commands()


# ---------------------------------------------------------------- keys of a rig file


def rig_keys() -> str:
    """Every key that a rig file may hold, from the tables that it is read by, with
    the words of rig-keys.toml.
    """
    from stickslip.io import rig_keys as keys
    from stickslip.model import Areas
    from stickslip.model.activation import ACTIVATIONS
    from stickslip.model.ageing import AGEING_MODELS
    from stickslip.model.delays import RandomDelay
    from stickslip.model.distributions import DISTRIBUTIONS

    words = tomllib.loads(
        (Path(__file__).parents[1] / "reference" / "rig-keys.toml").read_text()
    )
    lines = ["### At the top of the file", "", *_table(keys.TOP, words["top"])]
    for name, table in keys.TABLES.items():
        lines += [
            f"### `[{name}]`",
            "",
            *_table(table, (words["chain"] if name == "sheet" else {}) | words[name]),
        ]
        if name == "slider":
            for kind, each in keys.STRUCTURES.items():
                lines += [f"#### `slider.{kind}`", "", *_table(each, words[kind])]
        if name == "interface":
            heads = {
                (
                    "#### `thresholds`, `initial` and `newborn` with `distribution = "
                    '"{}"`'
                ): DISTRIBUTIONS,
                "#### `interface.delay` as a table": {"random": RandomDelay},
                "#### `interface.areas`": {"areas": Areas},
                '#### `interface.ageing` with `model = "{}"`': AGEING_MODELS,
                '#### `interface.activation` with `kind = "{}"`': ACTIVATIONS,
            }
            for head, records in heads.items():
                for kind, record in records.items():
                    own = words["fields"] | words.get(kind, {})
                    lines += [head.format(kind), "", *_table(keys.keys_of(record), own)]
        if name == "drive":
            lines += [
                "#### Each of `drive.pieces`",
                "",
                *_table(keys.PIECE, words["piece"]),
            ]
        if name == "simulation":
            lines += [
                "#### `simulation.start` as a table",
                "",
                *_table(keys.START, words["start"]),
            ]
    return "\n".join(lines)


def _table(keys: Any, words: Any) -> list[str]:
    rows = [
        "| key | value | for example | if left out | meaning |",
        "|---|---|---|---|---|",
    ]
    for name, key in keys.items():
        meaning, otherwise = (
            [words[name], ""] if isinstance(words[name], str) else words[name]
        )[:2]
        cells = (
            f"`{name}`",
            _kind(key),
            _code(key.example),
            _left_out(key, otherwise),
            meaning,
        )
        rows.append(
            f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"
        )
    return [*rows, ""]


def _code(value: Any) -> str:
    from stickslip.io.keys import toml

    return f"`{toml(value)}`"


def _left_out(key: Any, otherwise: str) -> str:
    """What is taken if a key is left out."""
    if key.required or key.default is None:
        return otherwise or "must be given"
    return (
        "none"
        if key.default == ""
        else _code(f"0 {_si(key)}" if key.unit and key.default == 0 else key.default)
    )


def _si(key: Any) -> str:
    from stickslip.model.units import si_unit

    return si_unit(key.unit)


def _kind(key: Any) -> str:
    """What may stand in place of a key's value, in words."""
    others = [
        "a table, see below" if other == "table" else _code(other)
        for other in key.also
        if other != "list"
    ]
    if key.unit:
        return " or ".join(
            [f"a quantity in {_si(key)}{f', {key.sign}' if key.sign else ''}", *others]
        )
    if key.choices:
        return " or ".join([*map(_code, key.choices), *others])
    if key.is_table:
        return (
            "list of tables, see below"
            if isinstance(key.example, list)
            else "a table, see below"
        )
    kinds = {
        str: "text",
        int: "whole number",
        list: "list of numbers",
        tuple: "list of numbers",
    }
    return kinds.get(type(key.example), f"number{f' {key.sign}' if key.sign else ''}")


class RigKeys(_Made):
    """``{rig-keys}``"""

    def text(self) -> str:
        return rig_keys()


# -------------------------------------------------------------- which method takes what


def mechanisms() -> str:
    """Mechanism by method: the matrix that tests/test_laws.py goes through, made of
    what the engines say they take.
    """
    import stickslip as ss
    from stickslip.simulation.engines import engine_of

    if str(ROOT / "tools") not in sys.path:
        sys.path.append(str(ROOT / "tools"))
    rigs = importlib.import_module("mechanisms")

    def taken(fields: dict[str, Any], method: object, body: object) -> str:
        try:
            engine_of(rigs.interface_with(fields), method, body)
        except ss.InputError:
            return ""
        return "yes"

    columns = [
        (method, body)
        for body in (rigs.SLIDER, rigs.CHAIN)
        for method in rigs.METHODS.values()
    ]
    columns = [
        column
        for column in columns
        if any(taken(fields, *column) for fields in rigs.MECHANISMS.values())
    ]
    heads = [
        f"`{type(method).__name__}`, {type(body).__name__.lower()}"
        for method, body in columns
    ]
    lines = [f"| interface | {' | '.join(heads)} |", "|---" * (1 + len(heads)) + "|"]
    for name, fields in rigs.MECHANISMS.items():
        lines.append(
            f"| {name} | {' | '.join(taken(fields, *column) for column in columns)} |"
        )
    return "\n".join(lines)


class Mechanisms(_Made):
    """``{mechanisms}``"""

    def text(self) -> str:
        return mechanisms()


# ---------------------------------------------------------------- claims


def claims(report: Path = REPORT) -> str:
    """The tables of claims with verdicts and numbers, from the report of
    ``make verify``.
    """
    if not report.exists():
        return (
            ":::{note}\nThis copy of the documentation was built without a report. "
            "`make verify` computes every figure "
            "and writes one; build the pages again after it. One figure at a time: "
            "`stickslip paper fig3 --check`.\n:::"
        )
    content: dict[str, Any] = json.loads(report.read_text(encoding="utf-8"))
    studies: list[dict[str, Any]] = content["studies"]
    lines: list[str] = []
    for group in dict.fromkeys(study["group"] for study in studies):
        lines += [
            f"### {group}",
            "",
            "| study | verdict | what was found |",
            "|---|---|---|",
        ]
        for study in studies:
            if study["group"] == group:
                lines += [
                    f"| {study['study']} | {_verdict(claim)} | {_found(claim)} |"
                    for claim in study["findings"]
                ]
        lines.append("")
    return "\n".join(lines)


def made_by(report: Path = REPORT) -> str:
    """Which version made the report, and whether it is stale; apart from `claims`,
    as its headings would go before.
    """
    if not report.exists():
        return ""
    content = json.loads(report.read_text(encoding="utf-8"))
    stale = stale_report(report)
    note = f":::{{warning}}\n{stale}\n:::\n\n" if stale else ""
    return f"{note}Made by {_cell(content['made_by'])}."


def stale_report(report: Path = REPORT) -> str:
    """Say which studies in the report are about other sources than these; nothing if
    none, or if there is no report.
    """
    if not report.exists():
        return ""
    if str(ROOT) not in sys.path:
        sys.path.append(str(ROOT))
    from verification.sources import fingerprint

    studies = json.loads(report.read_text(encoding="utf-8"))["studies"]
    stale = [
        study["study"]
        for study in studies
        if study["sources"] != fingerprint(study["rooms"])
    ]
    if not stale:
        return ""
    return (
        f"The solvers were changed after these studies: {', '.join(stale)}. `make "
        "verify` runs all of them again, "
        "`python -m verification --stale --report verification` no others."
    )


def _verdict(claim: dict[str, Any]) -> str:
    if not claim["ok"]:
        return "**FAILED**"
    return "holds" if claim["number"] is None else str(claim["verdict"])


def _found(claim: dict[str, Any]) -> str:
    """The statement, what it rests on, and its numbers to unfold."""
    number = "" if claim["number"] is None else f"Claim {claim['number']}: "
    parts = [f"{number}{_cell(claim['statement'])}"]
    parts += [
        f"*{word}:* {_cell(claim[key])}"
        for word, key in (("Reading", "reading"), ("Exact", "exact"))
        if claim[key]
    ]
    values = "<br>".join(_cell(line) for line in claim["lines"])
    parts.append(
        f"<details><summary>{_cell(claim['evidence'])}</summary>{values}</details>"
    )
    return "<br>".join(parts)


def _cell(value: object) -> str:
    text = ", ".join(map(str, value)) if isinstance(value, list) else str(value)
    return re.sub(r"([|*_`<>\\$])", r"\\\1", " ".join(text.split()))


class MadeBy(_Made):
    """``{made-by}``"""

    def text(self) -> str:
        self.env.note_dependency(str(REPORT))
        # The page itself says so, in a box: a page that cannot be built warns nobody.
        if stale := stale_report():
            logger.info("verification/report.json: %s", stale)
        return made_by()


class Claims(_Made):
    """``{claims}``"""

    def text(self) -> str:
        self.env.note_dependency(str(REPORT))
        return claims()


# ---------------------------------------------------------------- maths


def mathjax() -> Path:
    """MathJax with SVG output in one file, from the wheel that the extra ``docs``
    names.
    """
    for file in importlib.metadata.files("sphinx-mathjax-offline") or ():
        if file.name == "tex-svg.js":
            return Path(str(file.locate()))
    raise FileNotFoundError(
        "tex-svg.js in sphinx-mathjax-offline; pip install -e '.[docs]'"
    )


def _bring_mathjax(app: Sphinx) -> None:
    place = Path(app.outdir) / "_static"
    if app.builder.format == "html":
        place.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(mathjax(), place / "mathjax.js")


# ------------------------------------------------------ the gallery, where there is one


def keep_figure(block: Any, variables: dict[str, Any], gallery: dict[str, Any]) -> str:
    """Keep the figure that a script has made: ours come without pyplot, which the
    gallery would look into.
    """
    from sphinx_gallery.scrapers import figure_rst

    from stickslip import plot

    del block
    figure = variables["example_globals"].pop("figure", None)
    if figure is None:
        return ""
    path = next(variables["image_path_iterator"])
    plot.save(figure, path)
    return str(figure_rst([path], gallery["src_dir"]))


def _show_kernels_plain(app: Sphinx) -> None:
    """Put the plain functions in place of the compiled ones, which hide their
    signatures; the gallery has been made.
    """
    from importlib import import_module
    from pkgutil import iter_modules

    from numba.core.dispatcher import Dispatcher

    from stickslip import kernels

    del app
    for found in iter_modules(kernels.__path__, f"{kernels.__name__}."):
        module = import_module(found.name)
        for name, value in list(vars(module).items()):
            if isinstance(value, Dispatcher):
                setattr(module, name, value.py_func)


def _one_name_each(
    _app: Sphinx, _what: str, _name: str, _object: Any, _options: Any, lines: list[str]
) -> None:
    """Give attributes that share a line, ``low, high : float``, one each: napoleon
    takes the first for a type.
    """
    rewritten: list[str] = []
    inside, names, kind, about = False, [""], "", list[str]()

    def write_names() -> None:
        for name in names:
            rewritten.extend([name + kind, *about])

    for before, line in zip(["", *lines], [*lines, ""], strict=True):
        if set(line) == {"-"}:
            inside = before == "Attributes"
        if inside and (found := re.fullmatch(r"(\w+(?:, \w+)+)( : .*)", line)):
            write_names()
            names = found[1].split(", ")
            kind = found[2]
            about = []
        elif len(names) > 1 and line.startswith(" "):
            about.append(line)
        else:
            write_names()
            names = [line]
            kind = ""
            about = []
    lines[:] = rewritten[1:]


def setup(app: Sphinx) -> dict[str, Any]:
    app.add_directive("commands", Commands)
    app.add_directive("rig-keys", RigKeys)
    app.add_directive("mechanisms", Mechanisms)
    app.add_directive("claims", Claims)
    app.add_directive("made-by", MadeBy)
    app.connect("builder-inited", _bring_mathjax)
    # before napoleon
    app.connect("autodoc-process-docstring", _one_name_each, priority=400)
    app.connect("builder-inited", _show_kernels_plain, priority=900)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
