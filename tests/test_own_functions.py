"""What a function of the user's own counts by in the key of a study: whatever it takes, however it takes it."""

from __future__ import annotations

import importlib
import sys
from itertools import count

import pytest
from test_study_blocks import key_of

import femimpact as fi

pytestmark = pytest.mark.impacts

BODY = "def measure(response):\n    return "
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


CHANGES = {
    "code": "def measure(response):\n    return response.time[-$]",
    "constant": BODY + "$.0",
    "default": "def measure(response, factor=$):\n    return factor",
    "keyword's default": "def measure(response, *, factor=$):\n    return factor",
    "constant of the module": "FACTOR = $\n" + BODY + "FACTOR",
    "function of the module": "def helper():\n    return $\n" + BODY + "helper()",
    "function within": "def measure(response):\n    def inner():\n        return $\n    return inner()",
    "closure": "def made(factor):\n    def measure(response):\n        return factor\n    return measure\nmeasure = made($)",
    "function that a closure holds": "def made(function):\n    def measure(response):\n        return function()\n"
    "    return measure\nmeasure = made(lambda: $)",
    "comprehension": BODY + "sum([$ * time for time in response.time])",
    "generator expression": BODY + "sum($ * time for time in response.time)",
    "lambda": "measure = lambda response: $",
    "generator": "def steps():\n    yield $\n" + BODY + "next(steps())",
    "coroutine": "async def steps():\n    return $\n" + BODY + "run(steps())",
    "partial": "from functools import partial\ndef helper(a, b):\n    return a\nkept = partial(helper, $)\n" + BODY + "kept(2)",
    "partial as measure": "from functools import partial\ndef helper(a, response):\n    return a\nmeasure = partial(helper, $)",
    "partialmethod": "from functools import partialmethod\nclass Steel:\n    def of(self, a):\n        return a\n"
    "    first = partialmethod(of, $)\n" + BODY + "Steel().first()",
    "decorator": "from functools import wraps\ndef scaled(function):\n    @wraps(function)\n    def inner(response):\n"
    "        return $ * function(response)\n    return inner\n@scaled\n" + BODY + "1",
    "function beneath a decorator": "from functools import wraps\ndef scaled(function):\n    @wraps(function)\n"
    "    def inner(response):\n        return function(response)\n    return inner\n@scaled\n" + BODY + "$",
    "decorator that is an object": "from functools import update_wrapper\nclass Scaled:\n    def __init__(self, function):\n"
    "        self.function = function\n        update_wrapper(self, function)\n    def __call__(self, response):\n"
    "        return $ * self.function(response)\n@Scaled\ndef helper(response):\n    return 1\n" + BODY + "helper(response)",
    "function that is kept": "from functools import lru_cache\n@lru_cache\ndef helper():\n    return $\n" + BODY + "helper()",
    "function with an overload": "from functools import singledispatch\n@singledispatch\ndef helper(a):\n    return 0\n"
    "@helper.register\ndef of_int(a: int):\n    return $\n" + BODY + "helper(1)",
    "attribute of a function": "def helper():\n    return helper.factor\nhelper.factor = $\n" + BODY + "helper()",
    "attribute of a class": "class Steel:\n    strength = $\n" + BODY + "Steel.strength",
    "attribute of a base": "class Metal:\n    strength = $\nclass Steel(Metal):\n    pass\n" + BODY + "Steel.strength",
    "method": "class Steel:\n    def strength(self):\n        return $\n" + BODY + "Steel().strength()",
    "function that a method takes": "def helper():\n    return $\nclass Steel:\n    def strength(self):\n        return helper()\n"
    + BODY + "Steel().strength()",
    "property": "class Steel:\n    @property\n    def strength(self):\n        return $\n" + BODY + "Steel().strength",
    "kept property": "from functools import cached_property\nclass Steel:\n    @cached_property\n    def strength(self):\n"
    "        return $\n" + BODY + "Steel().strength",
    "static method": "class Steel:\n    @staticmethod\n    def strength():\n        return $\n" + BODY + "Steel.strength()",
    "class method": "class Steel:\n    @classmethod\n    def strength(cls):\n        return $\n" + BODY + "Steel.strength()",
    "metaclass": "class Kind(type):\n    @property\n    def strength(cls):\n        return $\n"
    "class Steel(metaclass=Kind):\n    pass\n" + BODY + "Steel.strength",
    "class within a class": "class Steel:\n    class Plate:\n        strength = $\n" + BODY + "Steel.Plate.strength",
    "class within the function": "def measure(response):\n    class Steel:\n        strength = $\n    return Steel.strength",
    "abstract base": "from abc import ABC, abstractmethod\nclass Metal(ABC):\n    @abstractmethod\n    def of(self):\n"
    "        return $\nclass Steel(Metal):\n    def of(self):\n        return super().of()\n" + BODY + "Steel().of()",
    "default of a dataclass": "from dataclasses import dataclass\n@dataclass\nclass Steel:\n    strength: float = $\n"
    + BODY + "Steel().strength",
    "factory of a dataclass": "from dataclasses import dataclass, field\n@dataclass\nclass Steel:\n"
    "    strength: list = field(default_factory=lambda: [$])\n" + BODY + "Steel().strength[0]",
    "field of a dataclass": "from dataclasses import dataclass\n@dataclass(frozen=True, slots=True)\nclass Steel:\n"
    "    strength: float\nSTEEL = Steel($)\n" + BODY + "STEEL.strength",
    "named tuple": "from typing import NamedTuple\nclass Steel(NamedTuple):\n    strength: float = $\n" + BODY + "Steel().strength",
    "attribute of an object": "class Steel:\n    def __init__(self, strength):\n        self.strength = strength\n"
    "STEEL = Steel($)\n" + BODY + "STEEL.strength",
    "slot of an object": "class Steel:\n    __slots__ = ('strength',)\nSTEEL = Steel()\nSTEEL.strength = $\n" + BODY + "STEEL.strength",
    "object that is called": "class Steel:\n    def __call__(self, response):\n        return $\nmeasure = Steel()",
    "attribute of one that is called": "class Steel:\n    def __init__(self, strength):\n        self.strength = strength\n"
    "    def __call__(self, response):\n        return self.strength\nmeasure = Steel($)",
    "attribute of the class of one that is called": "class Steel:\n    strength = $\n    def __call__(self, response):\n"
    "        return self.strength\nmeasure = Steel()",
    "method of an object as measure": "class Steel:\n    strength = $\n    def of(self, response):\n        return self.strength\n"
    "measure = Steel().of",
    "object that says little of itself": "class Steel:\n    def __getstate__(self):\n        return {}\nSTEEL = Steel()\n"
    "STEEL.strength = $\n" + BODY + "STEEL.strength",
    "member of an enumeration": "from enum import Enum\nclass Grade(Enum):\n    LOW = $\n    HIGH = 5\n" + BODY + "Grade.LOW.value",
    "enumeration as key": "from enum import Enum\nclass Grade(Enum):\n    LOW = $\nTABLE = {Grade.LOW: 3}\n"
    + BODY + "sum(grade.value for grade in TABLE)",
    "list": "VALUES = [0]\nVALUES.append($)\n" + BODY + "VALUES[1]",
    "mapping": "VALUES = {}\nVALUES['a'] = $\n" + BODY + "VALUES['a']",
    "mapping with a default": "from collections import defaultdict\nVALUES = defaultdict(lambda: $)\n" + BODY + "VALUES['a']",
    "mapping of a class of its own": "class Table(dict):\n    def __missing__(self, key):\n        return $\nVALUES = Table()\n"
    + BODY + "VALUES['a']",
    "array": "import numpy as np\nVALUES = np.zeros(3)\nVALUES[1] = $\n" + BODY + "VALUES[1]",
    "array of objects": "import numpy as np\nVALUES = np.array([$, None], dtype=object)\n" + BODY + "VALUES[0]",
    "array with a mask": "import numpy as np\nVALUES = np.ma.array([1., 2., 3.], mask=[0, $ - 1, 0])\n" + BODY + "VALUES.sum()",
    "random numbers": "import numpy as np\nRANDOM = np.random.default_rng($)\n" + BODY + "RANDOM.random()",
    "object of the standard library": "from operator import itemgetter\nkept = itemgetter($)\n" + BODY + "kept([1, 2, 3])",
    "which function of a library": "from scipy.special import erf, erfc\nkept = (erf, erf, erfc)[$]\n" + BODY + "kept(1.)",
    "function of a library under another's name": "import numpy as np\nfrom functools import wraps\n@wraps(np.mean)\n"
    "def mean(values):\n    return $\n" + BODY + "mean(response.time)",
    "attribute put into a class later": "class Steel:\n    pass\nSteel.strength = $\n" + BODY + "Steel.strength",
    "function put into a library": "import numpy as np\ndef mine(values):\n    return $\nnp.own_mean = mine\n"
    + BODY + "np.own_mean(response.time)",
    "one of two that are alike": "def made(n):\n    def inner():\n        return n\n    return inner\nclass Steel:\n"
    "    both = [made(1), made(2)]\n    kept = both[$ - 1]\n" + BODY + "Steel.kept()",
    "code without a file": "exec('def helper():\\n    return $')\n" + BODY + "helper()",
}  # fmt: skip
"""Scripts with `$`, which is 1 and then 2."""

IN_FILES = {
    "constant of a file": ("import own_helpers\n" + BODY + "own_helpers.FACTOR", "FACTOR = $", ""),
    "constant from a file": ("from own_helpers import FACTOR\n" + BODY + "FACTOR", "FACTOR = $", ""),
    "function of a file": ("import own_helpers\n" + BODY + "own_helpers.of()", "def of():\n    return $", ""),
    "function from a file": ("from own_helpers import of\n" + BODY + "of()", "def of():\n    return $", ""),
    "what a function of a file takes": (
        "from own_helpers import of\n" + BODY + "of()", "FACTOR = $\ndef of():\n    return FACTOR", "",
    ),
    "file as an argument": (
        "import own_helpers\ndef of(module):\n    return module.FACTOR\n" + BODY + "of(own_helpers)", "FACTOR = $", "",
    ),
    "file in a list": ("import own_helpers\nALL = [own_helpers]\n" + BODY + "ALL[0].FACTOR", "FACTOR = $", ""),
    "class from a file": ("from own_helpers import Steel\n" + BODY + "Steel.strength", "class Steel:\n    strength = $", ""),
    "base from a file": (
        "from own_helpers import Metal\nclass Steel(Metal):\n    pass\n" + BODY + "Steel.strength",
        "class Metal:\n    strength = $", "",
    ),
    "what a class from a file takes": (
        "from own_helpers import Steel\n" + BODY + "Steel().of()",
        "FACTOR = $\nclass Steel:\n    def of(self):\n        return FACTOR", "",
    ),
    "object from a file": (
        "from own_helpers import STEEL\n" + BODY + "STEEL.strength",
        "class Steel:\n    strength = $\nSTEEL = Steel()", "",
    ),
    "file of a file": (
        "import own_helpers\n" + BODY + "own_helpers.of()",
        "import own_deeper\ndef of():\n    return own_deeper.FACTOR", "FACTOR = $",
    ),
    "function of a file of a file": (
        "from own_helpers import of\n" + BODY + "of()",
        "from own_deeper import deeper\ndef of():\n    return deeper()", "def deeper():\n    return $",
    ),
    "file that the function loads": ("def measure(response):\n    import own_helpers\n    return own_helpers.FACTOR", "FACTOR = $", ""),
    "what the function loads from a file": (
        "def measure(response):\n    from own_helpers import of\n    return of()", "def of():\n    return $", "",
    ),
    "file that a function of a file loads": (
        "from own_helpers import of\n" + BODY + "of()",
        "def of():\n    from own_deeper import FACTOR\n    return FACTOR", "FACTOR = $",
    ),
    "what a file keeps by a name that is made": (
        "from own_helpers import of\n" + BODY + "of()", "TABLE = {}\nTABLE['a' + 'b'] = $\ndef of():\n    return TABLE['ab']", "",
    ),
    "attribute of a file put there later": (
        "import own_helpers\nown_helpers.FACTOR = $\n" + BODY + "own_helpers.of()", "FACTOR = 0\ndef of():\n    return FACTOR", "",
    ),
    "attribute of a file with a literal name": ("import own_helpers\n" + BODY + "getattr(own_helpers, 'FACTOR')", "FACTOR = $", ""),
    "attribute that a file makes": (
        "import own_helpers\n" + BODY + "own_helpers.FACTOR", "def __getattr__(name):\n    return $", "",
    ),
}  # fmt: skip

REFUSED = {
    "globals": "FACTOR = 1\n" + BODY + "globals()['FACTOR']",
    "attribute by a computed name": "class Steel:\n    strength = 1\n" + BODY + "getattr(Steel, 'stren' + str(response))",
    "attribute by one of two names": BODY + "getattr(response, 'a' if response else 'b')",
    "getattr under another name": "def measure(response):\n    get = getattr\n    return get(response, 'a')",
    "getattr as an argument": BODY + "list(map(getattr, [response], ['time']))",
    "getattr of builtins": "import builtins\n" + BODY + "builtins.getattr(response, str(response))",
    "module by its name": "import importlib\n" + BODY + "importlib.import_module('own_helpers').FACTOR",
    "module from the table of modules": "import sys\n" + BODY + "sys.modules['own_helpers'].FACTOR",
    "module without a file": "import types\nmodule = types.ModuleType('own')\nmodule.x = 1\n" + BODY + "module.x",
    "text that is code": BODY + "eval('1 + 1')",
    "globals in a method": "class Steel:\n    def of(self):\n        return globals()\n" + BODY + "Steel().of()",
    "globals of a function": BODY + "measure.__globals__['measure']",
    "lock": "import threading\nLOCK = threading.Lock()\n" + BODY + "LOCK",
    "generator that has begun": "STEPS = (i for i in range(3))\n" + BODY + "next(STEPS)",
    "function made for arrays": "import numpy as np\nkept = np.frompyfunc(lambda a: a, 1, 1)\n" + BODY + "kept(1)",
}


@pytest.mark.parametrize("text", CHANGES.values(), ids=CHANGES)
def test_a_change_of_what_a_function_takes_is_another_study(sources, text):
    first, again, changed = (sources.load(text.replace("$", number)) for number in "112")
    assert first == again
    assert first != changed


@pytest.mark.parametrize("texts", IN_FILES.values(), ids=IN_FILES)
def test_a_change_in_a_file_that_a_function_takes_is_another_study(sources, texts):
    first, again, changed = (sources.load(*(text.replace("$", number) for text in texts)) for number in "112")
    assert first == again
    assert first != changed


@pytest.mark.parametrize("text", REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_followed_asks_for_a_version(sources, text):
    with pytest.raises(fi.InputError, match=r"measure.*: uses values that cannot be compared .*: give version='...'"):
        sources.load(text, "FACTOR = 1")


SCRIPT = (
    "from own_helpers import of\nFACTOR = 1\nclass Steel:\n    strength = 1\n    def of(self):\n        return FACTOR\n"
    "def measure(response):\n    return of() + Steel().of()\n"
)
HELPER = "import own_deeper\ndef of():\n    return own_deeper.FACTOR\n"


@pytest.mark.parametrize(
    "texts",
    [
        ("# a comment\n\n" + SCRIPT.replace("FACTOR\n", "FACTOR  # another\n"), HELPER, "FACTOR = 1"),
        (SCRIPT.replace("    return of()", "\n\n    return  of( )"), HELPER, "FACTOR = 1"),
        (SCRIPT + "import math\nOTHER = 3\ndef plot(found):\n    return globals()\nclass Other:\n    pass\n", HELPER, "FACTOR = 1"),
        (SCRIPT, "# a comment\n" + HELPER.replace("    return", "\n    return"), "FACTOR = (1)  # another"),
        (SCRIPT, '"""What it is."""\n' + HELPER, '"""What it is."""\nFACTOR = 1'),
        (SCRIPT.replace("class Steel:", "class Steel:\n    'What it is.'"), HELPER, "FACTOR = 1"),
    ],
    ids=["comment", "form of the text", "plot elsewhere", "comment in a file", "docstring of a file", "docstring of a class"],
)  # fmt: skip
def test_what_decides_no_number_leaves_a_finished_study_as_it_is(sources, texts):
    assert sources.load(SCRIPT, HELPER, "FACTOR = 1") == sources.load(*texts)
