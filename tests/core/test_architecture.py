# SPDX-License-Identifier: GPL-3.0-or-later
"""Imports go down the floors of the house, and never in a circle."""

import ast
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import qh_unwrap

_PACKAGE = Path(qh_unwrap.__file__).parent
# From the ground up
_FLOORS = ("core", "patching", "addon", "console", "flags", "asked", "single", "farm", "cli", "__init__", "__main__")


def modules():
    """The package's modules by name, and the trees of their code."""
    for path in _PACKAGE.rglob("*.py"):
        yield ".".join(path.relative_to(_PACKAGE).with_suffix("").parts), ast.parse(path.read_text())


def imported(name, tree):
    """The names of the package's modules that a module imports, anywhere in it."""
    folder = name.split(".")[:-1]
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.level:
            base = folder[: len(folder) - node.level + 1] + (node.module.split(".") if node.module else [])
            for alias in node.names:
                if alias.name == "__version__":  # which everyone may know
                    continue
                whole = ".".join([*base, alias.name])
                yield whole if _is_module(whole) else ".".join(base) if _is_module(".".join(base)) else _of(base)


def _is_module(name):
    return Path(_PACKAGE, *name.split(".")).with_suffix(".py").is_file()


def _of(base):
    return ".".join([*base, "__init__"])


GRAPH = {name: set(imported(name, tree)) for name, tree in modules()}


def floor(name):
    return _FLOORS.index(name.split(".")[0])


def test_imports_go_down():
    assert not [(name, other) for name, others in GRAPH.items() for other in others if floor(other) > floor(name)]


def test_no_import_goes_in_a_circle():
    # A package's own file gathers what is in it, for others: within the package nobody asks it.
    within = {name: {other for other in others if not other.endswith("__init__")} for name, others in GRAPH.items()}
    assert len(list(TopologicalSorter(within).static_order())) >= len(within)
    assert not [name for name in GRAPH if name.startswith("core.") and "core.__init__" in GRAPH[name]]


@pytest.mark.parametrize("library", ["bpy", "bmesh", "mathutils"])
def test_the_core_knows_nothing_of_blender(library):
    for name, tree in modules():
        if name.startswith("core"):
            names = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
            names |= {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and not node.level}
            assert library not in {each.split(".")[0] for each in names}, name
