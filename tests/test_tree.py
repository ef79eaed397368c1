"""Three parts: the library, the application on it, and what decides the numbers of a study is where its key looks."""

from __future__ import annotations

from pathlib import Path

import pytest

import femimpact as fi
from femimpact import figures
from femimpact.app.parametric.identity import BESIDE, NUMERICAL

PACKAGE = Path(fi.__file__).parent


@pytest.mark.parametrize("place", [*NUMERICAL, *BESIDE])
def test_sources_that_are_in_the_key_of_a_study_are_there(place):
    # a folder that is missing would be hashed as nothing
    sources = list((PACKAGE / place).rglob("*.py")) if place in NUMERICAL else [PACKAGE / place]
    assert sources
    assert all(path.read_text(encoding="utf-8") for path in sources if path.name != "__init__.py")


def test_every_figure_is_loaded_by_its_name_and_no_other_is_known():
    assert dir(figures) == sorted(figures.__all__)
    assert all(getattr(figures, name) is not None for name in figures.__all__)
    with pytest.raises(AttributeError, match="no attribute 'no_such_figure'"):
        _ = figures.no_such_figure


@pytest.mark.parametrize("face", [fi, figures])
def test_no_public_function_has_the_name_of_a_module_beside_it(face):
    # the module would take the place of the function once it is loaded
    modules = {path.stem for path in Path(face.__file__).parent.iterdir() if path.suffix == ".py" or path.is_dir()}
    hidden = {name for name in face.__all__ if name in modules and callable(getattr(face, name))}
    assert hidden == set()
