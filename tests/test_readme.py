"""What README shows runs as it stands."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.impacts

README = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")


def test_the_script_of_the_readme_runs_as_it_stands(capsys):
    script = "\n".join(re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL))
    names: dict[str, object] = {}
    exec(compile(script, "README.md", "exec"), names)
    # the shapes and names are the public interface
    assert names["modes"].natural_frequency.shape == (4,)
    assert names["small"].dofs == 8
    assert names["response"].time.shape == names["response"]["tip"].shape == (19201,)
    np.testing.assert_array_equal(names["curve"].frequency, np.linspace(4, 6, 21))
    # the largest peak of the sweep: some millimetres, near the resonance of the beam with its ball
    peak, frequency = map(float, capsys.readouterr().out.splitlines()[0].split())
    assert 2e-3 < peak < 2e-2
    assert 4.5 < frequency < 5.7
    rigid = names["response"]
    assert len(rigid.impacts) > 100
    assert rigid.energy.residual < 1e-10


@pytest.mark.parametrize("path", sorted(set(re.findall(r"\]\(((?!http)[^)#]+)\)", README))))
def test_links_lead_somewhere(path):
    assert (Path(__file__).parent.parent / path).exists()


def test_the_two_commands_stand_on_lines_of_their_own():
    lines = README.splitlines()
    assert """python3 -m venv .venv && .venv/bin/pip install -e ".[movie,test]" && .venv/bin/femimpact demo""" in lines
    assert ".venv/bin/python -m pytest" in lines
