"""What the pages hold that is made from the code: commands, keys of a rig file, claims; and MathJax from its wheel."""

from __future__ import annotations

import importlib.metadata
import json
import re
import shutil
import sys
from pathlib import Path
from typing import Any
from unittest import mock

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

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

    with mock.patch.object(sys, "argv", ["stickslip"]):  # usage lines begin with the program that runs
        pages = app.generate_docs(output_format="markdown")
    # From the first command on; what precedes lists them once more.
    body = pages[pages.index("\n## stickslip ") :]
    # Options in running text keep their dashes; one without help ends in a colon.
    body = re.sub(r"(`[^`\n]*`)|(?<!\S)(--[a-z][\w-]*)", lambda found: found[1] or f"`{found[2]}`", body)
    return re.sub(r":\s*$", "", body, flags=re.MULTILINE)


class Commands(_Made):
    """``{commands}``"""

    def text(self) -> str:
        return commands()


# ---------------------------------------------------------------- keys of a rig file

UNITS = {
    "Mass": 'mass, such as `"75.6 g"`',
    "Stiffness": 'stiffness, such as `"4 MN/m"`',
    "Rate": 'rate, such as `"200 1/s"`',
    "Force": 'force, such as `"768 N"`',
    "Length": 'length, such as `"2 um"`',
    "Time": 'time, such as `"2 ms"`',
    "Lag": 'time, such as `"2 ms"`, or 0',
    "Velocity": 'speed, such as `"0.4 mm/s"`',
}


def rig_keys() -> str:
    """Every key that a rig file may hold, from the models that read it."""
    from pydantic import BaseModel

    from stickslip.io import rig_files as rig
    from stickslip.io import validation as door

    parts = {
        name: part
        for name, part in vars(rig).items()
        if isinstance(part, type) and issubclass(part, BaseModel) and part.__module__ == rig.__name__
    }
    names = {getattr(door, name).__metadata__[0]: words for name, words in UNITS.items()}
    content = parts["_Document"]
    lines = ["### At the top of the file", "", *_table(content, names)]
    for key, field in content.model_fields.items():
        inner = _models(field.annotation)
        for part in inner:
            lines += [f"### `[{key}]`", "", *_table(part, names)]
            for sub, subfield in part.model_fields.items():
                for distribution in _models(subfield.annotation):
                    heading = _heading(key, sub, distribution)
                    if heading not in lines:
                        lines += [heading, "", *_table(distribution, names)]
    return "\n".join(lines)


def _heading(key: str, sub: str, distribution: Any) -> str:
    tag = distribution.model_fields.get("distribution")
    if tag is None:
        return f"#### `{key}.{sub}`"
    kind = tag.annotation.__args__[0]
    where = "thresholds` and `interface.initial" if sub in ("thresholds", "initial") else sub
    return f'#### `{key}.{where}` with `distribution = "{kind}"`'


def _models(annotation: Any) -> list[Any]:
    """The models that an annotation can stand for."""
    from typing import get_args

    from pydantic import BaseModel

    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for inner in get_args(annotation) for model in _models(inner)]


def _table(part: Any, names: dict[Any, str]) -> list[str]:
    rows = ["| key | value | if left out | meaning |", "|---|---|---|---|"]
    for key, field in part.model_fields.items():
        if key == "distribution":
            continue
        if field.is_required():
            default = "must be given"
        elif (value := field.get_default(call_default_factory=True)) is None or value in ("", {}):
            default = "—"
        elif _models(field.annotation):
            given = value.model_dump(exclude_defaults=False)
            default = _toml(given) if "distribution" in given else "all its defaults"
        else:
            default = f"`{json.dumps(value)}`"
        meaning = " ".join((field.description or "").replace("``", "`").split())
        rows.append(f"| `{key}` | {_words(_full(part, key), names)} | {default} | {meaning} |")
    return [*rows, ""]


def _full(part: Any, key: str) -> Any:
    """The annotation with what pydantic has moved into the field's metadata."""
    from typing import get_type_hints

    return get_type_hints(part, include_extras=True)[key]


def _toml(values: dict[str, Any]) -> str:
    return "`{ " + ", ".join(f"{k} = {json.dumps(v)}" for k, v in values.items()) + " }`"


def _words(annotation: Any, names: dict[Any, str]) -> str:
    """An annotation in words."""
    from types import NoneType
    from typing import Literal, get_args, get_origin

    from pydantic import BaseModel

    for checked in getattr(annotation, "__metadata__", ()):
        if checked in names:
            return names[checked]
    if get_origin(annotation) is Literal:
        return " or ".join(f"`{json.dumps(value)}`" for value in get_args(annotation))
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return "a table, see below"
    simple = {float: "number", int: "whole number", str: "text", NoneType: ""}
    if annotation in simple:
        return simple[annotation]
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is list:
        inner = {"number": "numbers", "a table, see below": "tables, see below"}[_words(arguments[0], names)]
        return f"list of {inner}"
    if origin is dict:
        return "table of text"
    if hasattr(annotation, "__metadata__"):
        return _words(arguments[0], names)
    return " or ".join(dict.fromkeys(filter(None, (_words(inner, names) for inner in arguments))))


class RigKeys(_Made):
    """``{rig-keys}``"""

    def text(self) -> str:
        return rig_keys()


# ---------------------------------------------------------------- claims


def claims(report: Path = REPORT) -> str:
    """The tables of claims with verdicts and numbers, from the report of ``make verify``."""
    if not report.exists():
        return (
            ":::{note}\nThis copy of the documentation was built without a report. `make verify` computes every figure "
            "and writes one; build the pages again after it. One figure at a time: `stickslip paper fig3 --check`.\n:::"
        )
    content: dict[str, Any] = json.loads(report.read_text(encoding="utf-8"))
    studies: list[dict[str, Any]] = content["studies"]
    lines = [f"Made by version {_cell(content['stickslip'])} on {content['when']}.", ""]
    for group in dict.fromkeys(study["group"] for study in studies):
        lines += [f"### {group}", "", "| study | verdict | what was found |", "|---|---|---|"]
        for study in studies:
            if study["group"] == group:
                lines += [f"| {study['study']} | {_verdict(claim)} | {_found(claim)} |" for claim in study["findings"]]
        lines.append("")
    return "\n".join(lines)


def _verdict(claim: dict[str, Any]) -> str:
    if not claim["ok"]:
        return "**FAILED**"
    return "holds" if claim["number"] is None else str(claim["verdict"])


def _found(claim: dict[str, Any]) -> str:
    """The statement, what it rests on, and its numbers to unfold."""
    number = "" if claim["number"] is None else f"Claim {claim['number']}: "
    parts = [f"{number}{_cell(claim['statement'])}"]
    parts += [
        f"*{word}:* {_cell(claim[key])}" for word, key in (("Reading", "reading"), ("Exact", "exact")) if claim[key]
    ]
    values = "<br>".join(_cell(line) for line in claim["lines"])
    parts.append(f"<details><summary>{_cell(claim['evidence'])}</summary>{values}</details>")
    return "<br>".join(parts)


def _cell(value: object) -> str:
    text = ", ".join(map(str, value)) if isinstance(value, list) else str(value)
    return re.sub(r"([|*_`<>\\$])", r"\\\1", " ".join(text.split()))


class Claims(_Made):
    """``{claims}``"""

    def text(self) -> str:
        self.env.note_dependency(str(REPORT))
        return claims()


# ---------------------------------------------------------------- maths


def mathjax() -> Path:
    """MathJax with SVG output in one file, from the wheel that the extra ``docs`` names."""
    for file in importlib.metadata.files("sphinx-mathjax-offline") or ():
        if file.name == "tex-svg.js":
            return Path(str(file.locate()))
    raise FileNotFoundError("tex-svg.js in sphinx-mathjax-offline; pip install -e '.[docs]'")


def _bring_mathjax(app: Sphinx) -> None:
    place = Path(app.outdir) / "_static"
    if app.builder.format == "html":
        place.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(mathjax(), place / "mathjax.js")


# ---------------------------------------------------------------- the gallery, where there is one


def keep_figure(block: Any, variables: dict[str, Any], gallery: dict[str, Any]) -> str:
    """Keep the figure that a script has made: ours come without pyplot, which the gallery would look into."""
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
    """Put the plain functions in place of the compiled ones, which hide their signatures; the gallery has been made."""
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


def setup(app: Sphinx) -> dict[str, Any]:
    app.add_directive("commands", Commands)
    app.add_directive("rig-keys", RigKeys)
    app.add_directive("claims", Claims)
    app.connect("builder-inited", _bring_mathjax)
    app.connect("builder-inited", _show_kernels_plain, priority=900)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
