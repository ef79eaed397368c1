"""What a function of the user's own counts by in the key of a study: whatever it takes, however it takes it."""

from __future__ import annotations

import importlib
import sys
from itertools import count

import pytest
from test_study_blocks import key_of

import femimpact as fi

pytestmark = pytest.mark.impacts

MODULES = "own_script", "own_helpers", "own_deeper"
LOADED = count()


class Sources:
    """Texts of a script and of the modules beside it, each time in another folder."""

    def __init__(self, folder, monkeypatch):
        self.folder, self.monkeypatch = folder, monkeypatch

    def load(self, script, helpers="", deeper=""):
        """The function `measure` of the script."""
        folder = self.folder / str(next(LOADED))
        folder.mkdir()
        with self.monkeypatch.context() as patch:
            patch.syspath_prepend(folder)
            for name, text in zip(MODULES, (script, helpers, deeper), strict=True):
                (folder / f"{name}.py").write_text(text)
                sys.modules.pop(name, None)
            return key_of(importlib.import_module(MODULES[0]).measure)


@pytest.fixture
def sources(tmp_path, monkeypatch):
    yield Sources(tmp_path, monkeypatch)
    for name in MODULES:
        sys.modules.pop(name, None)


def by_name(texts):
    """Texts by the names above them; those of several files are parted."""
    found = {}
    for part in texts.strip().removeprefix("#### ").split("\n#### "):
        name, _, text = part.partition("\n")
        found[name] = text.split("\n#--\n")
    return found


CHANGES = by_name(r"""
#### code
def measure(response):
    return response.time[-$]
#### constant
def measure(response):
    return $.0
#### default
def measure(response, factor=$):
    return factor
#### keyword's default
def measure(response, *, factor=$):
    return factor
#### default of an attribute by literal names
def measure(response):
    return getattr(getattr(response, 'time'), 'first', $)
#### constant of the module
FACTOR = $
def measure(response):
    return FACTOR
#### function of the module
def helper():
    return $
def measure(response):
    return helper()
#### function within
def measure(response):
    def inner():
        return $
    return inner()
#### closure
def made(factor):
    def measure(response):
        return factor
    return measure
measure = made($)
#### function that a closure holds
def made(function):
    def measure(response):
        return function()
    return measure
measure = made(lambda: $)
#### comprehension
def measure(response):
    return sum([$ * time for time in response.time])
#### generator expression
def measure(response):
    return sum($ * time for time in response.time)
#### lambda
measure = lambda response: $
#### generator
def steps():
    yield $
def measure(response):
    return next(steps())
#### coroutine
async def steps():
    return $
def measure(response):
    return run(steps())
#### partial
from functools import partial
def helper(a, b):
    return a
kept = partial(helper, $)
def measure(response):
    return kept(2)
#### partial as measure
from functools import partial
def helper(a, response):
    return a
measure = partial(helper, $)
#### partialmethod
from functools import partialmethod
class Steel:
    def of(self, a):
        return a
    first = partialmethod(of, $)
def measure(response):
    return Steel().first()
#### decorator
from functools import wraps
def scaled(function):
    @wraps(function)
    def inner(response):
        return $ * function(response)
    return inner
@scaled
def measure(response):
    return 1
#### function beneath a decorator
from functools import wraps
def scaled(function):
    @wraps(function)
    def inner(response):
        return function(response)
    return inner
@scaled
def measure(response):
    return $
#### decorator that is an object
from functools import update_wrapper
class Scaled:
    def __init__(self, function):
        self.function = function
        update_wrapper(self, function)
    def __call__(self, response):
        return $ * self.function(response)
@Scaled
def helper(response):
    return 1
def measure(response):
    return helper(response)
#### function that is kept
from functools import lru_cache
@lru_cache
def helper():
    return $
def measure(response):
    return helper()
#### function with an overload
from functools import singledispatch
@singledispatch
def helper(a):
    return 0
@helper.register
def of_int(a: int):
    return $
def measure(response):
    return helper(1)
#### attribute of a function
def helper():
    return helper.factor
helper.factor = $
def measure(response):
    return helper()
#### attribute of a class
class Steel:
    strength = $
def measure(response):
    return Steel.strength
#### attribute of a base
class Metal:
    strength = $
class Steel(Metal):
    pass
def measure(response):
    return Steel.strength
#### method
class Steel:
    def strength(self):
        return $
def measure(response):
    return Steel().strength()
#### function that a method takes
def helper():
    return $
class Steel:
    def strength(self):
        return helper()
def measure(response):
    return Steel().strength()
#### property
class Steel:
    @property
    def strength(self):
        return $
def measure(response):
    return Steel().strength
#### kept property
from functools import cached_property
class Steel:
    @cached_property
    def strength(self):
        return $
def measure(response):
    return Steel().strength
#### static method
class Steel:
    @staticmethod
    def strength():
        return $
def measure(response):
    return Steel.strength()
#### class method
class Steel:
    @classmethod
    def strength(cls):
        return $
def measure(response):
    return Steel.strength()
#### metaclass
class Kind(type):
    @property
    def strength(cls):
        return $
class Steel(metaclass=Kind):
    pass
def measure(response):
    return Steel.strength
#### class within a class
class Steel:
    class Plate:
        strength = $
def measure(response):
    return Steel.Plate.strength
#### class within the function
def measure(response):
    class Steel:
        strength = $
    return Steel.strength
#### abstract base
from abc import ABC, abstractmethod
class Metal(ABC):
    @abstractmethod
    def of(self):
        return $
class Steel(Metal):
    def of(self):
        return super().of()
def measure(response):
    return Steel().of()
#### default of a dataclass
from dataclasses import dataclass
@dataclass
class Steel:
    strength: float = $
def measure(response):
    return Steel().strength
#### factory of a dataclass
from dataclasses import dataclass, field
@dataclass
class Steel:
    strength: list = field(default_factory=lambda: [$])
def measure(response):
    return Steel().strength[0]
#### field of a dataclass
from dataclasses import dataclass
@dataclass(frozen=True, slots=True)
class Steel:
    strength: float
STEEL = Steel($)
def measure(response):
    return STEEL.strength
#### named tuple
from typing import NamedTuple
class Steel(NamedTuple):
    strength: float = $
def measure(response):
    return Steel().strength
#### attribute of an object
class Steel:
    def __init__(self, strength):
        self.strength = strength
STEEL = Steel($)
def measure(response):
    return STEEL.strength
#### slot of an object
class Steel:
    __slots__ = ('strength',)
STEEL = Steel()
STEEL.strength = $
def measure(response):
    return STEEL.strength
#### object that is called
class Steel:
    def __call__(self, response):
        return $
measure = Steel()
#### attribute of one that is called
class Steel:
    def __init__(self, strength):
        self.strength = strength
    def __call__(self, response):
        return self.strength
measure = Steel($)
#### attribute of the class of one that is called
class Steel:
    strength = $
    def __call__(self, response):
        return self.strength
measure = Steel()
#### method of an object as measure
class Steel:
    strength = $
    def of(self, response):
        return self.strength
measure = Steel().of
#### object that says little of itself
class Steel:
    def __getstate__(self):
        return {}
STEEL = Steel()
STEEL.strength = $
def measure(response):
    return STEEL.strength
#### member of an enumeration
from enum import Enum
class Grade(Enum):
    LOW = $
    HIGH = 5
def measure(response):
    return Grade.LOW.value
#### enumeration as key
from enum import Enum
class Grade(Enum):
    LOW = $
TABLE = {Grade.LOW: 3}
def measure(response):
    return sum(grade.value for grade in TABLE)
#### list
VALUES = [0]
VALUES.append($)
def measure(response):
    return VALUES[1]
#### mapping
VALUES = {}
VALUES['a'] = $
def measure(response):
    return VALUES['a']
#### mapping with a default
from collections import defaultdict
VALUES = defaultdict(lambda: $)
def measure(response):
    return VALUES['a']
#### mapping of a class of its own
class Table(dict):
    def __missing__(self, key):
        return $
VALUES = Table()
def measure(response):
    return VALUES['a']
#### array
import numpy as np
VALUES = np.zeros(3)
VALUES[1] = $
def measure(response):
    return VALUES[1]
#### array of objects
import numpy as np
VALUES = np.array([$, None], dtype=object)
def measure(response):
    return VALUES[0]
#### array with a mask
import numpy as np
VALUES = np.ma.array([1., 2., 3.], mask=[0, $ - 1, 0])
def measure(response):
    return VALUES.sum()
#### random numbers
import numpy as np
RANDOM = np.random.default_rng($)
def measure(response):
    return RANDOM.random()
#### object of the standard library
from operator import itemgetter
kept = itemgetter($)
def measure(response):
    return kept([1, 2, 3])
#### which function of a library
from scipy.special import erf, erfc
kept = (erf, erf, erfc)[$]
def measure(response):
    return kept(1.)
#### function of a library under another's name
import numpy as np
from functools import wraps
@wraps(np.mean)
def mean(values):
    return $
def measure(response):
    return mean(response.time)
#### attribute put into a class later
class Steel:
    pass
Steel.strength = $
def measure(response):
    return Steel.strength
#### function put into a library
import numpy as np
def mine(values):
    return $
np.own_mean = mine
def measure(response):
    return np.own_mean(response.time)
#### one of two that are alike
def made(n):
    def inner():
        return n
    return inner
class Steel:
    both = [made(1), made(2)]
    kept = both[$ - 1]
def measure(response):
    return Steel.kept()
#### code without a file
exec('def helper():\n    return $')
def measure(response):
    return helper()
""")
"""Scripts with `$`, which is 1 and then 2."""

IN_FILES = by_name(r"""
#### constant of a file
import own_helpers
def measure(response):
    return own_helpers.FACTOR
#--
FACTOR = $
#### constant from a file
from own_helpers import FACTOR
def measure(response):
    return FACTOR
#--
FACTOR = $
#### function of a file
import own_helpers
def measure(response):
    return own_helpers.of()
#--
def of():
    return $
#### function from a file
from own_helpers import of
def measure(response):
    return of()
#--
def of():
    return $
#### what a function of a file takes
from own_helpers import of
def measure(response):
    return of()
#--
FACTOR = $
def of():
    return FACTOR
#### file as an argument
import own_helpers
def of(module):
    return module.FACTOR
def measure(response):
    return of(own_helpers)
#--
FACTOR = $
#### file in a list
import own_helpers
ALL = [own_helpers]
def measure(response):
    return ALL[0].FACTOR
#--
FACTOR = $
#### class from a file
from own_helpers import Steel
def measure(response):
    return Steel.strength
#--
class Steel:
    strength = $
#### base from a file
from own_helpers import Metal
class Steel(Metal):
    pass
def measure(response):
    return Steel.strength
#--
class Metal:
    strength = $
#### what a class from a file takes
from own_helpers import Steel
def measure(response):
    return Steel().of()
#--
FACTOR = $
class Steel:
    def of(self):
        return FACTOR
#### object from a file
from own_helpers import STEEL
def measure(response):
    return STEEL.strength
#--
class Steel:
    strength = $
STEEL = Steel()
#### file of a file
import own_helpers
def measure(response):
    return own_helpers.of()
#--
import own_deeper
def of():
    return own_deeper.FACTOR
#--
FACTOR = $
#### function of a file of a file
from own_helpers import of
def measure(response):
    return of()
#--
from own_deeper import deeper
def of():
    return deeper()
#--
def deeper():
    return $
#### file that the function loads
def measure(response):
    import own_helpers
    return own_helpers.FACTOR
#--
FACTOR = $
#### what the function loads from a file
def measure(response):
    from own_helpers import of
    return of()
#--
def of():
    return $
#### file that a function of a file loads
from own_helpers import of
def measure(response):
    return of()
#--
def of():
    from own_deeper import FACTOR
    return FACTOR
#--
FACTOR = $
#### what a file keeps by a name that is made
from own_helpers import of
def measure(response):
    return of()
#--
TABLE = {}
TABLE['a' + 'b'] = $
def of():
    return TABLE['ab']
#### attribute of a file put there later
import own_helpers
own_helpers.FACTOR = $
def measure(response):
    return own_helpers.of()
#--
FACTOR = 0
def of():
    return FACTOR
#### attribute of a file with a literal name
import own_helpers
def measure(response):
    return getattr(own_helpers, 'FACTOR')
#--
FACTOR = $
#### attribute that a file makes
import own_helpers
def measure(response):
    return own_helpers.FACTOR
#--
def __getattr__(name):
    return $
""")
"""The same with the module own_helpers, and some with own_deeper."""

REFUSED = by_name(r"""
#### globals
FACTOR = 1
def measure(response):
    return globals()['FACTOR']
#### attribute by a computed name
class Steel:
    strength = 1
def measure(response):
    return getattr(Steel, 'stren' + str(response))
#### attribute by one of two names
def measure(response):
    return getattr(response, 'a' if response else 'b')
#### getattr under another name
def measure(response):
    get = getattr
    return get(response, 'a')
#### getattr as an argument
def measure(response):
    return list(map(getattr, [response], ['time']))
#### getattr of builtins
import builtins
def measure(response):
    return builtins.getattr(response, str(response))
#### module by its name
import importlib
def measure(response):
    return importlib.import_module('own_helpers').FACTOR
#### module from the table of modules
import sys
def measure(response):
    return sys.modules['own_helpers'].FACTOR
#### module without a file
import types
module = types.ModuleType('own')
module.x = 1
def measure(response):
    return module.x
#### text that is code
def measure(response):
    return eval('1 + 1')
#### globals in a method
class Steel:
    def of(self):
        return globals()
def measure(response):
    return Steel().of()
#### globals of a function
def measure(response):
    return measure.__globals__['measure']
#### lock
import threading
LOCK = threading.Lock()
def measure(response):
    return LOCK
#### generator that has begun
STEPS = (i for i in range(3))
def measure(response):
    return next(STEPS)
#### function made for arrays
import numpy as np
kept = np.frompyfunc(lambda a: a, 1, 1)
def measure(response):
    return kept(1)
""")


@pytest.mark.parametrize("texts", (CHANGES | IN_FILES).values(), ids=CHANGES | IN_FILES)
def test_a_change_of_what_a_function_takes_is_another_study(sources, texts):
    first, again, changed = (sources.load(*(text.replace("$", number) for text in texts)) for number in "112")
    assert first == again
    assert first != changed


@pytest.mark.parametrize("texts", REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_followed_asks_for_a_version(sources, texts):
    with pytest.raises(fi.InputError, match=r"measure.*: uses a value that .* cannot recognise .*: give version='...'"):
        sources.load(*texts, "FACTOR = 1")


SCRIPT = """from own_helpers import of
FACTOR = 1
class Steel:
    strength = 1
    def of(self):
        return FACTOR
def measure(response):
    return of() + Steel().of()
"""
HELPER = """import own_deeper
def of():
    return own_deeper.FACTOR
"""
ELSEWHERE = """import math
OTHER = 3
def plot(found):
    return globals()
class Other:
    pass
"""


@pytest.mark.parametrize(
    ("script", "helpers", "deeper"),
    [
        pytest.param("# a comment\n\n" + SCRIPT.replace("1\n", "1  # m\n"), HELPER, "FACTOR = 1", id="comment"),
        pytest.param(SCRIPT.replace("    return of()", "\n    return  of( )"), HELPER, "FACTOR = 1", id="form"),
        pytest.param(SCRIPT + ELSEWHERE, HELPER, "FACTOR = 1", id="plot elsewhere"),
        pytest.param(SCRIPT, "# a comment\n" + HELPER, "FACTOR = (1)  # m", id="comment in a file"),
        pytest.param(SCRIPT, '"""What it is."""\n' + HELPER, '"""It."""\nFACTOR = 1', id="docstring of a file"),
        pytest.param(SCRIPT.replace("Steel:", "Steel:\n    'It.'"), HELPER, "FACTOR = 1", id="docstring of a class"),
    ],
)
def test_what_decides_no_number_leaves_a_finished_study_as_it_is(sources, script, helpers, deeper):
    assert sources.load(SCRIPT, HELPER, "FACTOR = 1") == sources.load(script, helpers, deeper)
