"""What numba works out thousands of times while it compiles is worked out once, and gives the same kernels.

Of the time that a kernel takes to compile this saves a fifth. Both functions are numba's own inner ones.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from numba.core.targetconfig import ConfigStack, TargetConfig
from numba.core.types.functions import BaseFunction


def take_shortcuts() -> None:
    """Replace what numba asks for most often, in this process, by functions that know the answer already."""
    TargetConfig.values = option_values  # type: ignore[method-assign]
    BaseFunction.get_call_type = resolved_once(BaseFunction.get_call_type)  # type: ignore[method-assign]


def option_values(options: Any) -> dict[str, Any]:
    """Return the values of a kernel's options by name, and defaults for those that are not set.

    Numba does so for each two that it compares, in Python, by a property an option.
    """
    kind: Any = type(options)
    return _defaults(kind) | options._values  # type: ignore[no-any-return]


@cache
def _defaults(kind: Any) -> dict[str, Any]:
    """Return the defaults of a kind of options."""
    return {name: option.default for name, option in kind.options.items()}


def resolved_once(resolve: Callable[..., Any]) -> Callable[..., Any]:
    """Return `resolve`, which finds the variant of a function such as `*` for types of arguments, with a memory.

    Numba tries all variants for each product of a kernel anew. A failure is not remembered: it may end.
    """
    answers: dict[Any, Any] = {}
    stack: Any = ConfigStack

    def get_call_type(function: Any, context: Any, arguments: Any, keywords: Any) -> Any:
        # the variant may be a kernel of numba's, which is compiled with the options of its caller
        key = function, context, tuple(arguments), tuple(keywords.items()), stack.top_or_none()
        if key not in answers:
            signature = resolve(function, context, arguments, keywords)
            answers[key] = signature, function.get_impl_key(signature)
        signature, variant = answers[key]
        function._impl_keys[signature.args] = variant  # where numba looks for it when it makes code of the call
        return signature

    return get_call_type
