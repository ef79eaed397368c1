from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

class _BuildInfo(TypedDict):
    target: str
    targets: tuple[str, ...]
    compiler: str
    sources: str
    kind: str

__all__ = ["build_info", "choose_target", "exponentials"]

def build_info() -> _BuildInfo: ...
def choose_target(level: float, asked: str, /) -> str: ...
def exponentials(exponent: NDArray[np.complex128], time: float, out: NDArray[np.complex128], /) -> None: ...
