"""A public noun that checks its fields says in its docstring what it refuses."""

from __future__ import annotations

import ast
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "femimpact"

CHECKS = {"check_fields", "require", "require_type"}


def _is_frozen_dataclass(node: ast.ClassDef) -> bool:
    return any(
        isinstance(call, ast.Call)
        and ast.unparse(call.func) == "dataclass"
        and any(word.arg == "frozen" and ast.unparse(word.value) == "True" for word in call.keywords)
        for call in node.decorator_list
    )


def _checks_its_fields(node: ast.ClassDef) -> bool:
    made = (part for part in node.body if isinstance(part, ast.FunctionDef) and part.name == "__post_init__")
    calls = (call for part in made for call in ast.walk(part) if isinstance(call, ast.Call))
    return any(isinstance(call.func, ast.Name) and call.func.id in CHECKS for call in calls)


def _nouns() -> dict[str, str]:
    """Docstring of every public frozen dataclass that checks its fields."""
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in sorted(PACKAGE.rglob("*.py"))]
    classes = (node for tree in trees for node in tree.body if isinstance(node, ast.ClassDef))
    return {
        node.name: ast.get_docstring(node) or ""
        for node in classes
        if not node.name.startswith("_") and _is_frozen_dataclass(node) and _checks_its_fields(node)
    }


def test_every_noun_that_checks_its_fields_says_what_it_refuses():
    nouns = _nouns()
    # as many as there are at least: a walk that found none would pass
    assert {"Rigid", "Sine", "System", "Response", "EventDriven", "Mesh", "Study"} <= set(nouns)
    without = {name for name, words in nouns.items() if "\nRaises\n------\nInputError\n    " not in words}
    assert without == set()
