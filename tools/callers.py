"""Which definitions of a package use which others, by name: what a change of one of
them can affect.

A name is followed through ``from package.module import name`` and
``from package import module``, at the top of a module or inside a function. A function
that passes on a whole module may use all of it. Methods are not followed.
"""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path

Name = tuple[str, str]
"""A definition: its module, as in ``stickslip.kernels.drive``, and its name there."""


class Callers:
    """The definitions of a package, what uses them, and on which lines.

    Parameters
    ----------
    package : Path
        Folder of the package.
    """

    def __init__(self, package: Path) -> None:
        self._users: dict[Name, set[Name]] = defaultdict(set)
        self._lines: dict[Name, set[tuple[Path, int]]] = defaultdict(set)
        self._spans: dict[Path, list[tuple[int, int, Name]]] = {}
        modules = {
            ".".join(
                (package.name, *file.relative_to(package).with_suffix("").parts)
            ).removesuffix(".__init__"): file
            for file in package.rglob("*.py")
        }
        for module, file in modules.items():
            tree = ast.parse(file.read_text(encoding="utf-8"))
            here = {
                name: (module, name) for node in tree.body for name in _defined(node)
            }
            package_of = (
                module if file.name == "__init__.py" else module.rpartition(".")[0]
            )
            known = here | _imported(tree.body, package_of, set(modules))
            self._spans[file] = []
            for node in tree.body:
                names = _defined(node)
                first = min(
                    [
                        node.lineno,
                        *(each.lineno for each in getattr(node, "decorator_list", [])),
                    ]
                )
                self._spans[file] += [
                    (first, node.end_lineno or first, (module, name)) for name in names
                ]
                for used, line in _used(node, known, package_of, set(modules)):
                    self._lines[used].add((file, line))
                    for name in names:
                        if used != (module, name):
                            self._users[used].add((module, name))

    def at(self, file: Path, line: int) -> set[Name]:
        """Return the definition at a line of a module; the whole module if the line is
        outside all definitions.
        """
        found = {
            name for first, last, name in self._spans[file] if first <= line <= last
        }
        return found or {name for _, _, name in self._spans[file]}

    def reached(self, changed: set[Name]) -> set[Name]:
        """Return these definitions and all that use one of them, directly or through
        others.
        """
        found = set(changed)
        open_ = list(changed)
        while open_:
            module, name = open_.pop()
            more = (self._users[module, name] | self._users[module, ""]) - found
            found |= more
            open_ += more
        return found

    def lines(self, names: set[Name]) -> set[tuple[Path, int]]:
        """Return the lines on which one of these definitions is used."""
        return {
            place
            for module, name in names
            for place in self._lines[module, name] | self._lines[module, ""]
        }


def _defined(node: ast.stmt) -> list[str]:
    if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
        return [node.name]
    targets = (
        node.targets
        if isinstance(node, ast.Assign)
        else [node.target]
        if isinstance(node, ast.AnnAssign)
        else []
    )
    return [
        name.id
        for target in targets
        for name in ast.walk(target)
        if isinstance(name, ast.Name)
    ]


def _imported(
    nodes: list[ast.stmt], package: str, modules: set[str]
) -> dict[str, Name]:
    """Return the definition that each imported name refers to, for the imports among
    these statements; for a whole module the definition's name is empty.
    """
    found: dict[str, Name] = {}
    for node in nodes:
        if isinstance(node, ast.If):  # ``if TYPE_CHECKING``
            found |= _imported(node.body, package, modules)
        elif isinstance(node, ast.ImportFrom):
            above = package.rsplit(".", node.level - 1)[0] if node.level else ""
            module = ".".join(filter(None, (above, node.module)))
            for alias in node.names:
                whole = f"{module}.{alias.name}"
                found[alias.asname or alias.name] = (
                    (whole, "") if whole in modules else (module, alias.name)
                )
    return found


def _used(
    node: ast.AST, known: dict[str, Name], package: str, modules: set[str]
) -> list[tuple[Name, int]]:
    """Return the definitions used in a statement, each with its line."""
    found: list[tuple[Name, int]] = []
    if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
        known = known | _imported(
            [each for each in ast.walk(node) if isinstance(each, ast.ImportFrom)],
            package,
            modules,
        )
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        module, name = known.get(node.value.id, ("", ""))
        if module and not name:
            return [((module, node.attr), node.lineno)]
    if isinstance(node, ast.Name) and node.id in known:
        found.append((known[node.id], node.lineno))
    for child in ast.iter_child_nodes(node):
        found += _used(child, known, package, modules)
    return found
