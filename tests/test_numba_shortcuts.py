"""What numba is told instead of working it out is what it would work out."""

from __future__ import annotations

import operator

import pytest
from numba import types
from numba.core.compiler import Flags
from numba.core.registry import cpu_target
from numba.core.targetconfig import ConfigStack
from numba.core.types.functions import BaseFunction

from hapticeval.compiled import NUMBA_IS_KNOWN
from hapticeval.numba_shortcuts import resolved_once

pytestmark = pytest.mark.skipif(not NUMBA_IS_KNOWN, reason="numba does it all by itself")

CONTEXT = cpu_target.typing_context


@pytest.fixture
def function():
    """Return numba's type of the operator *."""
    CONTEXT.refresh()  # numba learns its own functions before it compiles for the first time
    return CONTEXT.resolve_value_type(operator.mul)


@pytest.fixture
def counted(function):
    """Return numba's own resolution with a memory of its own, and the list of those that it was asked for."""
    asked = []

    def resolve(function, context, arguments, keywords):
        asked.append(arguments)
        if types.none in arguments:
            raise TypeError
        signature = types.float64(*arguments)
        function._impl_keys[signature.args] = len(asked)
        return signature

    return resolved_once(resolve), asked


def test_options_have_the_values_that_are_set_and_defaults_for_others():
    flags = Flags()
    flags.nrt = True
    flags.error_model = "numpy"
    assert flags.values() == {name: getattr(flags, name) for name in Flags.options}
    # and so those are equal that say the same, a default too
    other = flags.copy()
    other.noalias = Flags.options["noalias"].default
    assert flags == other
    assert hash(flags) == hash(other)
    other.noalias = True
    assert flags != other


def test_a_call_is_resolved_once_for_types_and_options(function, counted):
    resolve, asked = counted
    numbers, whole_numbers = (types.float64, types.float64), (types.int64, types.int64)
    assert resolve(function, CONTEXT, numbers, {}) is resolve(function, CONTEXT, numbers, {})
    assert asked == [numbers]
    resolve(function, CONTEXT, whole_numbers, {})
    flags = Flags()
    flags.nrt = True
    with ConfigStack().enter(flags):
        resolve(function, CONTEXT, numbers, {})
    assert asked == [numbers, whole_numbers, numbers]


def test_the_code_of_a_call_is_that_of_its_own_resolution(function, counted):
    resolve, _ = counted
    numbers = types.float64, types.float64
    first = resolve(function, CONTEXT, numbers, {})
    function._impl_keys[first.args] = "of another kernel"
    assert function.get_impl_key(resolve(function, CONTEXT, numbers, {})) == 1


def test_what_cannot_be_called_is_asked_again(function, counted):
    resolve, asked = counted
    for _ in range(2):
        with pytest.raises(TypeError):
            resolve(function, CONTEXT, (types.none,), {})
    assert len(asked) == 2


def test_numba_uses_them(function):
    types_of_product = types.float64, types.int64
    signature = BaseFunction.get_call_type(function, CONTEXT, types_of_product, {})
    assert signature.return_type == types.float64
    assert signature is BaseFunction.get_call_type(function, CONTEXT, types_of_product, {})
