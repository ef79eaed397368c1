"""What a type checker and a completion see of the package are its public names, and all of them."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest
from public import FOLDERS

import femimpact as fi

ROOT = Path(__file__).parents[1]
SCRIPT = ROOT / "tests" / "data" / "user_script.py"


def _checked(script: Path, tmp_path: Path) -> subprocess.CompletedProcess[str]:
    """Strict mypy on a script outside of the repository: nothing of the repository's settings is read."""
    pytest.importorskip("mypy")
    (tmp_path / "script.py").write_text(script.read_text(encoding="utf-8"), encoding="utf-8")
    # without the types of numpy it takes two seconds, with them forty
    options = ["--strict", "--no-site-packages", "--ignore-missing-imports", "--follow-imports=silent"]
    program = [sys.executable, "-m", "mypy", *options, "--cache-dir", str(tmp_path / "cache"), "script.py"]
    return subprocess.run(program, cwd=tmp_path, env={"MYPYPATH": str(ROOT)}, capture_output=True, text=True)


def test_a_strict_checker_knows_the_names_of_a_script(tmp_path):
    done = _checked(SCRIPT, tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("folder", ["", *sorted({*FOLDERS} - {"vtk"})])
def test_names_for_the_checker_are_the_public_ones(folder):
    face = getattr(fi, folder) if folder else fi
    tree = ast.parse((ROOT / "femimpact" / folder / "__init__.pyi").read_text(encoding="utf-8"))
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    # `X as X` is what makes an imported name public to a checker
    given = {alias.asname: (node.module, alias.name) for node in imports for alias in node.names}
    assert sorted([*given, *([] if folder else ["__version__"])]) == sorted(face.__all__)
    assert dir(face) == sorted(face.__all__)
    for name, (module, original) in given.items():
        assert name == original
        assert getattr(face, name) is getattr(sys.modules[module or "femimpact"], original)


def test_completion_offers_the_public_names_only():
    assert dir(fi) == sorted(fi.__all__)
    assert [name for name in dir(fi) if name.startswith("_")] == ["__version__"]


def test_the_package_says_that_it_has_types():
    assert (Path(fi.__file__).parent / "py.typed").is_file()
