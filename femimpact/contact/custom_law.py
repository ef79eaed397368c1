"""A contact law that a user writes: its checks, its address for the compiled loop, and what it raised."""

from __future__ import annotations

import ctypes
import inspect
import math
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.util import find_spec
from typing import Any, ClassVar, TypeAlias

from scipy import LowLevelCallable

from femimpact.contact.collision import Collision, integrated_collision
from femimpact.contact.laws import ContactParameters
from femimpact.errors import Fault, InputError, check_fields, checked, name_text, quantity, require

ForceFunction: TypeAlias = Any
"""A function of Python, one that numba has compiled, one of ctypes, or a scipy.LowLevelCallable."""

NUMBERS = (ctypes.c_double,) * 3

PROTOTYPE = ctypes.CFUNCTYPE(ctypes.c_double, *NUMBERS)

SIGNATURE = "double (double, double, double)"

POINTER: Any = PROTOTYPE.__base__
"""The type of all function pointers of ctypes."""

REQUIRED = (
    "must be a function of depth, rate, approach_speed: of Python, of ctypes with three c_double and a c_double "
    f"returned, or a scipy.LowLevelCallable of '{SIGNATURE}' without user data"
)


@dataclass(frozen=True, eq=False)
class ForcePointer:
    """A law's force as a C function."""

    address: int
    function: Callable[[float, float, float], float]
    """The same for Python to call."""
    kept_alive: object
    """Object whose memory holds the code at the address."""
    in_python: bool
    """True if each call runs a function of Python."""
    raised: threading.local = field(default_factory=threading.local)
    """Last exception of the function of Python in this thread."""


def is_force(force: object) -> bool:
    """True if a value may be a law's force; its signature is checked by `force_pointer`."""
    return not inspect.isclass(force) and (callable(force) or isinstance(force, LowLevelCallable))


def as_function(force: ForceFunction) -> Callable[[float, float, float], float]:
    """The function for Python to call.

    Raises `InputError` if it is no force, or a pointer of another signature.
    """
    plain: Any = getattr(force, "py_func", force)
    function: Callable[[float, float, float], float] = plain if _is_plain(plain) else force_pointer(force).function
    return function


def force_pointer(
    force: ForceFunction,  # of penetration (m), its rate (m/s) and the approach speed (m/s) to the normal force (N)
) -> ForcePointer:
    """The C function of a law's force; the same for the same function.

    Raises `InputError` if it is no force, or a pointer of another signature.
    """
    if not is_force(force):
        raise _refused(force)
    plain = getattr(force, "py_func", force)
    if _is_plain(plain):
        try:
            return _of_python(plain)
        except TypeError:  # what has no hash is kept by nobody else
            return _of_python.__wrapped__(plain)
    return _of_pointer(force)


def law_error(
    name: str,  # of the contact pair
    pointer: ForcePointer,
    depth: float,  # m
    rate: float,  # m/s
    approach_speed: float,  # m/s
) -> BaseException:
    """The error that ends a run whose custom law gave no finite force for these numbers.

    Returns: with what the function raised as its cause; an interrupt itself.
    """
    cause: BaseException | None = getattr(pointer.raised, "error", None)
    pointer.raised.error = None
    if isinstance(cause, KeyboardInterrupt):
        return cause
    value = math.nan
    try:
        value = float(pointer.function(depth, rate, approach_speed))
    except Exception as error:
        cause = error
    where = f"at depth {depth:.6g} m, rate {rate:.6g} m/s and approach speed {approach_speed:.6g} m/s"
    key = f"{name}.contact.force"
    if cause is None:
        return InputError([Fault(key, value, "N", f"must be finite, {where}")])
    named = raised_error(key, cause, where)
    named.__cause__ = cause
    return named


def raised_error(key: str, cause: BaseException, where: str) -> InputError:
    """The error that names what a law's function has raised."""
    words = " ".join(str(cause).split())
    return InputError([Fault(key, None, "", f"raised {type(cause).__name__}: {words}, {where}")])


def speed_note(name: str, pointer: ForcePointer) -> str:
    """A note on a law that is called as a function of Python; empty where it is not."""
    if not pointer.in_python:
        return ""
    if find_spec("numba") is None:
        cure = "install femimpact[laws], which compiles it by numba"
    else:
        cure = "numba cannot compile it: use floats and math only"
    return (
        f"{name}.contact: its force is called as a function of Python, some 0.2 us a call and one thread at a time: "
        f"{cure}, or give a scipy.LowLevelCallable"
    )


def _is_plain(force: object) -> bool:
    """True for a function of Python, which is no pointer."""
    return callable(force) and not isinstance(force, POINTER | LowLevelCallable) and not hasattr(force, "ctypes")


def _refused(force: object) -> InputError:
    return InputError([Fault("contact.force", getattr(force, "__name__", repr(force)), "", REQUIRED)])


@lru_cache(maxsize=256)
def _of_python(force: Callable[[float, float, float], float]) -> ForcePointer:
    """The pointer of a function of Python; the cache keeps what is compiled."""
    compiled = _compiled(force)
    if compiled is not None:
        return ForcePointer(int(compiled.address), force, compiled, in_python=False)
    raised = threading.local()

    def guarded(depth: float, rate: float, approach_speed: float) -> float:
        # ctypes would print what is raised, and go on with another number
        try:
            return float(force(depth, rate, approach_speed))
        except BaseException as error:
            raised.error = error
            return math.nan

    callback = PROTOTYPE(guarded)
    return ForcePointer(_address(callback), force, callback, in_python=True, raised=raised)


def _compiled(force: Callable[[float, float, float], float]) -> Any:
    """The function compiled by numba, or None where numba is not installed or cannot compile it."""
    try:
        import numba
    except ImportError:
        return None
    try:
        inner = numba.njit(error_model="numpy", nogil=True)(force)

        def guarded(depth: float, rate: float, approach_speed: float) -> float:
            # what is raised in such a function is lost
            try:
                return float(inner(depth, rate, approach_speed))
            except Exception:
                return math.nan

        return numba.cfunc("float64(float64, float64, float64)", error_model="numpy")(guarded)
    except Exception:
        # whatever the compiler raises is about the user's function, which Python can still call
        return None


def _of_pointer(force: Any) -> ForcePointer:
    """The pointer of a C function."""
    if isinstance(force, LowLevelCallable):
        # a tuple of a capsule, what it was made of and the user data; its class forbids indexing
        if force.signature.replace(" ", "") != SIGNATURE.replace(" ", "") or force.user_data is not None:
            raise _refused(force)
        capsule = tuple.__getitem__(force, 0)
        name, pointer = ctypes.pythonapi.PyCapsule_GetName, ctypes.pythonapi.PyCapsule_GetPointer
        name.restype, name.argtypes = ctypes.c_char_p, (ctypes.py_object,)
        pointer.restype, pointer.argtypes = ctypes.c_void_p, (ctypes.py_object, ctypes.c_char_p)
        address = int(pointer(capsule, name(capsule)) or 0)
    else:
        function = force if isinstance(force, POINTER) else force.ctypes
        arguments = getattr(function, "argtypes", None) or getattr(function, "_argtypes_", None) or ()
        if tuple(arguments) != NUMBERS or function.restype is not ctypes.c_double:
            raise _refused(force)
        address = _address(function)
    if not address:
        raise _refused(force)
    return ForcePointer(address, PROTOTYPE(address), force, in_python=False)


def _address(function: Any) -> int:
    return ctypes.cast(function, ctypes.c_void_p).value or 0


@dataclass(frozen=True)
class CustomLaw:
    """A law that a user writes: N = force(depth, rate, approach_speed), never below zero.

    Parameters
    ----------
    force : callable or scipy.LowLevelCallable
        Function of three floats, penetration (m), its rate (m/s) and the approach speed at the start of the contact
        (m/s; see `State` where a run starts within it), to the normal force (N). Its elastic part is
        force(depth, 0, approach_speed). The loop over steps calls it as a C function: a function of Python is compiled
        by numba where that is installed (the extra `laws`), else each call is one of Python, some 0.2 us. C functions
        are taken as they are: of ctypes with three c_double and a c_double returned, of numba.cfunc, or a
        scipy.LowLevelCallable of "double (double, double, double)". A function of Python that raises ends the run with
        its error; a C function cannot raise, and ends the run only by a force that is no finite number.
    name : str
    reference_speed : float, m/s
        At which the contact time of step recommendations is taken.
    """

    force: ForceFunction
    name: str = field(default="custom", metadata=name_text())
    reference_speed: float = field(default=0.25, metadata=quantity("m/s", above=0.0))
    restitution: ClassVar[float | None] = None
    may_be_preloaded: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_fields(self)
        require(is_force(self.force), "force", self.force, "", "must be a function of depth, rate, approach_speed")
        as_function(self.force)

    def normal_force(self, depth: float, rate: float, approach_speed: float, effective_mass: float) -> float:
        """Force (N): what the function gives, none off the wall and never below zero."""
        return max(self._finite_force(depth, rate, approach_speed), 0.0) if depth > 0.0 else 0.0

    def potential(self, depth: float, effective_mass: float, approach_speed: float) -> float:
        """Energy (J) stored: the integral of force(p, 0, approach_speed)."""
        if depth <= 0.0:
            return 0.0
        from scipy.integrate import quad

        return float(quad(lambda p: self._finite_force(p, 0.0, approach_speed), 0.0, depth)[0])

    def collide(self, effective_mass: float, approach_speed: float) -> Collision:
        """One collision, integrated."""

        def force(depth: float, rate: float) -> float:
            return self.normal_force(depth, rate, approach_speed, effective_mass)

        return integrated_collision(force, effective_mass, approach_speed)

    def parameters(self, effective_mass: float) -> ContactParameters:
        """Numbers for the time loop, of a collision at the reference speed."""
        typical = self.collide(effective_mass, self.reference_speed)
        return ContactParameters.of_function(typical.contact_time, typical.restitution)

    def force_function(self, effective_mass: float) -> ForceFunction:
        """The function itself."""
        return self.force

    def shown_numbers(self, effective_mass: float) -> tuple[tuple[str, float, str], ...]:
        """Empty, as no number characterises a function."""
        return ()

    def _finite_force(self, depth: float, rate: float, approach_speed: float) -> float:
        try:
            force = as_function(self.force)(depth, rate, approach_speed)
        except Exception as error:
            where = f"at depth {depth:.6g} m, rate {rate:.6g} m/s and approach speed {approach_speed:.6g} m/s"
            raise raised_error(f"{self.name}.force", error, where) from error
        return float(checked(f"{self.name}.force", force, quantity("N")))
