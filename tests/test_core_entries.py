"""Functions of the compiled core: what they take is checked at every call, argument by argument."""

from __future__ import annotations

import numpy as np
import pytest

from femimpact import core

EPS = np.finfo(float).eps


def numbers(count=5, dtype=complex):
    return np.linspace(-1.0, 0.0, count).astype(dtype)


def released():
    view = memoryview(numbers())
    view.release()
    return view


def misaligned():
    return np.frombuffer(bytearray(16 * 5 + 1), dtype=complex, offset=1)


def read_only():
    array = numbers()
    array.flags.writeable = False
    return array


def test_exponentials_are_those_of_numpy():
    random = np.random.default_rng(1)
    exponent = -random.uniform(0.0, 9.0, 21) + 1j * random.uniform(-50.0, 50.0, 21)
    out = np.empty_like(exponent)
    core.exponentials(exponent, 0.7, out)
    exact = np.exp(0.7 * exponent)
    # of the product's rounding at an angle up to 35, and two units of own rounding with one of the library's
    assert np.all(np.abs(out - exact) <= 40.0 * EPS * np.abs(exact))


@pytest.mark.parametrize("count", [0, 1])
def test_few_numbers_are_taken(count):
    out = numbers(count)
    core.exponentials(numbers(count), 0.0, out)
    assert np.all(out == 1.0)


def test_an_array_of_one_has_any_stride():
    out = numbers(6)[::6]
    core.exponentials(numbers(1), 0.0, out)
    assert out[0] == 1.0


@pytest.mark.parametrize(
    ("wrong", "error", "why"),
    [
        (None, TypeError, "this is none"),
        ("text", TypeError, "this is none"),
        ([1j] * 5, TypeError, "this is none"),
        (released(), TypeError, "this is none"),
        (b"bytes", TypeError, "another type"),
        (numbers(dtype=np.complex64), TypeError, "another type"),
        (numbers(dtype=float), TypeError, "another type"),
        (numbers(dtype=object), TypeError, "another type"),
        (numbers(dtype=">c16"), TypeError, "another type"),
        (np.zeros(5, dtype=[("a", complex)]), TypeError, "another type"),
        (np.zeros(5, dtype="M8[s]"), TypeError, "this is none"),
        (np.array(1j), ValueError, "0 axes"),
        (numbers(6).reshape(2, 3), ValueError, "2 axes"),
        (numbers(10)[::2], ValueError, "not contiguous"),
        (numbers(5)[::-1], ValueError, "not contiguous"),
        (np.broadcast_to(numbers(1), 5), ValueError, "not contiguous"),
        (misaligned(), ValueError, "not aligned"),
    ],
    ids=lambda value: str(value).partition(" at 0x")[0],
)
@pytest.mark.parametrize("name", ["exponent", "out"])
def test_what_is_no_array_of_the_kind_is_named(name, wrong, error, why):
    arguments = {"exponent": numbers(), "out": numbers()} | {name: wrong}
    with pytest.raises(error, match=rf"^{name}: must be a contiguous.* array \(K,\) of complex128; .*{why}$"):
        core.exponentials(arguments["exponent"], 1.0, arguments["out"])


def test_what_is_written_must_be_writable_and_what_is_read_need_not():
    with pytest.raises(ValueError, match=r"^out: .* read-only$"):
        core.exponentials(numbers(), 1.0, read_only())
    core.exponentials(read_only(), 1.0, numbers())


def test_arrays_are_equally_long():
    with pytest.raises(ValueError, match="exponent and out: must be equally long, are 5 and 4"):
        core.exponentials(numbers(5), 1.0, numbers(4))


@pytest.mark.parametrize("time", [None, "1", 1j, [1.0], np.zeros(2)])
def test_a_time_is_a_number(time):
    with pytest.raises(TypeError, match=r"^time: must be a number$"):
        core.exponentials(numbers(), time, numbers())


@pytest.mark.parametrize("count", [0, 1, 2, 4])
def test_the_number_of_arguments_is_named(count):
    with pytest.raises(TypeError, match=f"exponentials: takes 3 arguments, not {count}"):
        core.exponentials(*[numbers()] * count)


def test_an_interrupt_within_an_argument_is_passed_on():
    class Interrupting:
        def __float__(self):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        core.exponentials(numbers(), Interrupting(), numbers())


def test_an_array_is_let_go_after_a_call_and_after_a_refusal():
    # one that is held cannot be resized
    out = bytearray(16 * 5)
    core.exponentials(numbers(), 1.0, np.frombuffer(out, dtype=complex))
    with pytest.raises(ValueError, match="equally long"):
        core.exponentials(numbers(4), 1.0, np.frombuffer(out, dtype=complex))
    out.append(0)
