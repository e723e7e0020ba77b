"""What is passed around in the core is frozen, and equal by identity where it holds arrays; what is read has names."""

import dataclasses
import importlib
import pkgutil

import msgspec
import pytest

CORE = ("hapticeval.phenomena", "hapticeval.phenomena.checks", "hapticeval.suite", "hapticeval.recordings")
JUDGING = "hapticeval.runner.judging"


def core_types(is_kind):
    """The types of one kind in the core's rooms: of recordings the type and its file, not the rooms of the lab."""
    packages = map(importlib.import_module, CORE)
    names = [found.name for room in packages for found in pkgutil.iter_modules(room.__path__, f"{room.__name__}.")]
    for module in map(importlib.import_module, (*names, JUDGING)):
        for name, value in vars(module).items():
            if isinstance(value, type) and value.__module__ == module.__name__ and is_kind(value):
                yield pytest.param(value, id=f"{module.__name__.removeprefix('hapticeval.')}.{name}")


def is_struct(kind):
    return issubclass(kind, msgspec.Struct)


@pytest.mark.parametrize("kind", list(core_types(dataclasses.is_dataclass)))
def test_a_value_is_frozen_and_equal_by_identity_where_it_holds_arrays(kind):
    options = kind.__dataclass_params__
    assert options.frozen
    # Arrays have no truth value, so that values with arrays, or with a recording of them, cannot be compared.
    if any(word in str(field.type) for field in dataclasses.fields(kind) for word in ("Array", "Recording")):
        assert not options.eq


@pytest.mark.parametrize("kind", list(core_types(is_struct)))
def test_what_is_read_is_frozen_and_takes_names_only(kind):
    assert kind.__struct_config__.frozen
    assert kind.__struct_config__.forbid_unknown_fields, "a misspelt entry is refused"
    with pytest.raises(TypeError, match="positional"):
        kind("by place")
