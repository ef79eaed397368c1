"""What a function of the user's own counts by in the key of a study: code, texts of files, and values that it reads."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from test_study_blocks import GAP, key_of, small, study

import femimpact as fi
from femimpact.app.parametric import identity
from femimpact.app.parametric.identity import plain_study

pytestmark = pytest.mark.impacts

MODULES = "own_script", "own_helpers", "own_deeper"


class Sources:
    """A script and modules beside it, which are loaded anew each time."""

    def __init__(self, folder, monkeypatch):
        self.folder = folder
        monkeypatch.syspath_prepend(folder)

    def load(self, *texts):
        """The modules of these texts, the script first."""
        for name, text in zip(MODULES, texts, strict=False):
            sys.modules.pop(name, None)
            # what is compiled is found by the time and size of a text
            (self.folder / "__pycache__" / f"{name}.{sys.implementation.cache_tag}.pyc").unlink(missing_ok=True)
            (self.folder / f"{name}.py").write_text(text)
        importlib.invalidate_caches()
        script = importlib.import_module(MODULES[0])
        return SimpleNamespace(script=script, helpers=sys.modules.get(MODULES[1]), deeper=sys.modules.get(MODULES[2]))


@pytest.fixture
def sources(tmp_path, monkeypatch):
    yield Sources(tmp_path, monkeypatch)
    for name in MODULES:
        sys.modules.pop(name, None)


def by_name(texts):
    """Texts by the names above them; those of one script are parted."""
    found = {}
    for part in texts.strip().removeprefix("#### ").split("\n#### "):
        name, _, text = part.partition("\n")
        found[name] = text.split("\n#--\n")
    return found


READ = by_name(r"""
#### constant
FACTOR = 1
def measure(response):
    return FACTOR * response.time[-1]
#--
script.FACTOR = 2
#### constant that a helper reads
FACTOR = 1
def helper():
    return FACTOR
def measure(response):
    return helper()
#--
script.FACTOR = 2
#### code of a helper
def helper():
    return 1
def other():
    return 2
def measure(response):
    return helper()
#--
script.helper.__code__ = script.other.__code__
#### default of a helper
def helper(factor=1):
    return factor
def measure(response):
    return helper()
#--
script.helper.__defaults__ = (2,)
#### dict
VALUES = {"a": 1, 2: 3}
def measure(response):
    return VALUES["a"]
#--
script.VALUES["a"] = 2
#### array
import numpy as np
VALUES = np.zeros(3)
def measure(response):
    return VALUES[1]
#--
script.VALUES[1] = 1e-300
#### frozen dataclass
from dataclasses import dataclass, replace
@dataclass(frozen=True, slots=True)
class Steel:
    strength: float = 1.0
    def of(self):
        return self.strength
STEEL = Steel(2.0)
def measure(response):
    return STEEL.of()
#--
script.STEEL = script.replace(script.STEEL, strength=1.0)
#### what its method reads
from dataclasses import dataclass
FACTOR = 1
@dataclass(frozen=True)
class Steel:
    @property
    def strength(self):
        return FACTOR
def measure(response):
    return Steel().strength
#--
script.FACTOR = 2
#### partial
from functools import partial
def of(factor, response):
    return factor
measure = partial(of, 1)
measure.__name__ = "measure"
#--
script.measure = script.partial(script.of, 2)
script.measure.__name__ = "measure"
#### constant of another file
import own_helpers
def measure(response):
    return own_helpers.FACTOR
#--
helpers.FACTOR = 2
#--
FACTOR = 1
#### constant of a file of a file
import own_helpers
def measure(response):
    return own_helpers.of()
#--
deeper.FACTOR = 2
#--
import own_deeper
def of():
    return own_deeper.FACTOR
#--
FACTOR = 1
""")
"""Scripts, what changes a value while they are loaded, and the texts of the modules beside them."""


@pytest.mark.parametrize("texts", READ.values(), ids=READ)
def test_a_changed_value_that_a_function_reads_is_another_study(sources, texts):
    script, change, *others = texts
    modules = sources.load(script, *others)
    first = key_of(modules.script.measure)
    assert key_of(modules.script.measure) == first
    modules.script.OTHER = 3
    assert key_of(modules.script.measure) == first
    exec(change, vars(modules))
    assert key_of(modules.script.measure) != first


CHAIN = (
    "import own_helpers\ndef measure(response):\n    return own_helpers.of()\n",
    "def of():\n    from own_deeper import deeper\n    return deeper()\n",
    "def deeper():\n    return 1\n",
)


def test_the_text_of_every_file_that_is_imported_counts_wherever_they_lie(sources, tmp_path):
    keys = [key_of(sources.load(*CHAIN).script.measure)]
    for i in range(3):
        texts = [text + "# a note\n" * (i == j) for j, text in enumerate(CHAIN)]
        keys.append(key_of(sources.load(*texts).script.measure))
    assert len(set(keys)) == 4
    sources.folder = tmp_path / "elsewhere"
    sources.folder.mkdir()
    sys.path.insert(0, str(sources.folder))
    assert key_of(sources.load(*CHAIN).script.measure) == keys[0]


def test_files_of_a_package_are_found_without_being_loaded(sources, tmp_path):
    package = tmp_path / "own_package"
    package.mkdir()
    (package / "__init__.py").write_text("raise SystemExit('is not loaded')")
    (package / "inner.py").write_text("from . import beside\n")
    (package / "beside.py").write_text("FACTOR = 1\n")
    script = "def measure(response):\n    from own_package.inner import beside\n    return beside.FACTOR\n"
    measure = sources.load(script).script.measure
    one = plain_study(fi.app.ParameterStudy(study(), {GAP: [2e-3]}, [measure], cycles=3))["files"]
    assert set(one) == {"own_script", "own_package", "own_package.inner", "own_package.beside"}


def test_two_closures_and_two_lambdas_of_one_line_are_two_functions(sources):
    script = sources.load(
        "def make(k):\n    def measure(response):\n        return k\n    return measure\n"
        "one, other = lambda response: 1.0, lambda response: 2.0\n"
    ).script
    assert key_of(script.make(1)) == key_of(script.make(1))
    assert len({key_of(one) for one in (script.make(1), script.make(2), script.one, script.other)}) == 4


REFUSED = by_name(r"""
#### SPLINE, a CubicSpline
from scipy.interpolate import CubicSpline
SPLINE = CubicSpline([0.0, 1.0, 2.0], [0.0, 1.0, 4.0])
def measure(response):
    return SPLINE(0.5)
#### STEEL, a Steel
class Steel:
    strength = 1
STEEL = Steel()
def measure(response):
    return STEEL.strength
#### Steel.measure, a bound method
class Steel:
    def measure(self, response):
        return 1
measure = Steel().measure
#### kept, a function of C
kept = "a".count
def measure(response):
    return kept("a")
#### VALUES, a set
VALUES = {1, 2}
def measure(response):
    return sum(VALUES)
#### VALUES, a ndarray
import numpy as np
VALUES = np.array([1, None], dtype=object)
def measure(response):
    return VALUES[0]
#### helper, a function without a file
exec("def helper():\n    return 1")
def measure(response):
    return helper()
#### values that hold one another
VALUES = []
VALUES.append(VALUES)
def measure(response):
    return VALUES
#### what measure takes by globals
FACTOR = 1
def measure(response):
    return globals()["FACTOR"]
""")
"""Scripts by what is named in the error."""


@pytest.mark.parametrize(("words", "texts"), REFUSED.items(), ids=REFUSED)
def test_what_is_no_plain_data_is_refused_by_name_and_asks_for_a_version(sources, words, texts):
    measure = sources.load(*texts, "FACTOR = 1").script.measure
    with pytest.raises(fi.InputError) as caught:
        key_of(measure)
    assert f"measure': uses a value that a later call cannot recognise ({words}" in str(caught.value)
    assert "): give version='...'" in str(caught.value)


def test_a_version_stands_for_what_is_no_plain_data_in_a_study_on_disk_alone(sources, tmp_path):
    measure = sources.load(*REFUSED["SPLINE, a CubicSpline"]).script.measure
    whole = small(measures=[measure])
    with pytest.raises(fi.InputError, match="give version="):
        small(tmp_path / "study", measures=[measure])
    assert not (tmp_path / "study").exists()
    first = small(tmp_path / "study", measures=[measure], version="1")
    np.testing.assert_array_equal(first["measure"], whole["measure"])
    with pytest.raises(fi.InputError, match=r'measures\[0\].version is "1" there, "2" here'):
        small(tmp_path / "study", measures=[measure], version="2")


def test_a_changed_value_is_named_where_its_numbers_are_kept(sources, tmp_path):
    script = sources.load(*READ["constant"][:1]).script
    first = small(tmp_path, measures=[script.measure])
    np.testing.assert_array_equal(small(tmp_path, measures=[script.measure])["measure"], first["measure"])
    script.FACTOR = 2
    with pytest.raises(fi.InputError, match=r"another study: measures\[0\].reads.FACTOR is 1 there, 2 here"):
        small(tmp_path, measures=[script.measure])


def test_functions_that_call_one_another_and_those_of_libraries_have_a_key(sources):
    script = sources.load(
        "from math import sin\nimport numpy as np\nfrom numpy import mean\nfrom scipy.special import erf\n"
        "def even(n):\n    return n == 0 or odd(n - 1)\n"
        "def odd(n):\n    return n != 0 and even(n - 1)\n"
        "def measure(response):\n    return float(even(2)) + sin(1) + np.sum([1]) + mean([1]) + erf(1.0) + len('a')"
    ).script
    assert key_of(script.measure) == key_of(script.measure)


def test_the_key_of_a_function_is_the_same_in_every_process(tmp_path):
    # a set of texts has another order in each
    script = tmp_path / "script.py"
    script.write_text(
        f"import sys\nsys.path[:0] = [{str(Path(__file__).parent)!r}]\n"
        "from test_study_blocks import key_of\n"
        "def measure(response):\n    return float(response.regime.label in {'one', 'two', 'three'})\n"
        "print(key_of(measure))\n"
    )
    keys = set()
    for seed in ("1", "2"):
        found = {**os.environ, "PYTHONPATH": str(Path(fi.__file__).parent.parent), "PYTHONHASHSEED": seed}
        told = subprocess.run([sys.executable, script], env=found, check=True, capture_output=True, text=True)
        keys.add(told.stdout)
    assert len(keys) == 1


def test_a_folder_of_sources_that_is_missing_is_an_error(monkeypatch):
    root = Path(fi.__file__).parent
    assert all(list((root / name).rglob("*.py")) for name in identity.NUMERICAL)
    assert all((root / name).is_file() for name in identity.BESIDE)
    whole = identity.sources_key.__wrapped__()
    for name, words in (("NUMERICAL", "no sources in moved"), ("BESIDE", "moved")):
        with monkeypatch.context() as patch:
            patch.setattr(identity, name, (*getattr(identity, name)[1:], "moved"))
            with pytest.raises(FileNotFoundError, match=words):
                identity.sources_key.__wrapped__()
    monkeypatch.setattr(identity, "BESIDE", identity.BESIDE[1:])
    assert identity.sources_key.__wrapped__() != whole
