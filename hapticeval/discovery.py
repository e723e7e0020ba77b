"""Names of renderers, and the factories behind them: ours and a third party's are found alike.

    BASE[+SCHEME][@REPRESENTATION]

- `BASE` is an entry point of the group `hapticeval.renderers`, or `package.module:factory`.
- `+SCHEME` chooses a regulation scheme. Its own name may hold a plus: only the first one separates.
- `@REPRESENTATION` chooses how the model is stored.

The last two are for a factory that has a choice of them. Behind the scheme, or in its place, may stand `+MODIFIER`, an
entry point of the group `hapticeval.modifiers`, which changes what any renderer answers: `constraint+pp-v+pc@curve`.

    lib:PATH        a shared library with the C ABI of `hapticeval header`
    cmd:COMMAND     a process that speaks JSON lines

Code is named on the command line only: `resolve_installed` resolves the names that files give.
"""

from __future__ import annotations

import difflib
import re
import sys
import traceback
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import EntryPoint
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from hapticeval.errors import InputError, UnknownNameError, describe_error, renderer_errors
from hapticeval.registrations import by_name, entries_of

if TYPE_CHECKING:
    from hapticeval.renderer import RendererFactory

RENDERER_GROUP = "hapticeval.renderers"
FIELD = "hapticeval.renderers.field"
"""The group of renderers that are found by name as any, and run only where they are named: those of the field."""
LISTS = "hapticeval.known"
"""Entry points `package:file.toml`: the known failures of a package's renderers. Nothing of the package is run."""

MODIFIERS = "hapticeval.modifiers"
"""The group of what makes of a renderer's factory that of the same renderer changed."""

ADAPTERS = {"lib": "hapticeval.adapters.library:library", "cmd": "hapticeval.adapters.process:process"}
"""Names of renderers that are not Python: what stands before the colon, to what makes a factory of the rest."""
LIBRARY_ENDINGS = (".so", ".dll", ".dylib")
"""How the files of shared libraries end."""

DISTRIBUTION = "hapticeval"


@dataclass(frozen=True)
class Name:
    """A renderer's name in its parts; `regulation` and `representation` are None where none is asked for."""

    base: str
    regulation: str | None
    representation: str | None


def parse(name: str) -> Name:
    """Split `BASE[+SCHEME][@REPRESENTATION]` into its parts. Raises `InputError` for a part that is empty.

    What is not Python has no variants: a path and a command are taken as they are.
    """
    # `lib:` and `cmd:` first: what follows may hold a plus or an at sign of its own.
    kind, colon, address = name.partition(":")
    if colon and kind in ADAPTERS:
        if not address.strip():
            raise InputError(f"'{name}' does not name a renderer", todo="write lib:./libmine.so, or cmd:./mine")
        return Name(name, None, None)
    front, at, representation = name.partition("@")
    # The first plus alone separates: pp+v is one scheme.
    base, plus, regulation = front.partition("+")
    # A separator with nothing after it was meant to name something.
    if not base or (plus and not regulation) or (at and not representation):
        raise InputError(
            f"'{name}' does not name a renderer",
            why="a part of BASE[+SCHEME][@REPRESENTATION] is empty",
            todo="name an entry point or package.module:factory: constraint, constraint+pp, mine:make",
        )
    return Name(base, regulation if plus else None, representation if at else None)


def shipped_lists() -> list[Path]:
    """Return the files of known failures that installed packages have, in the order of their entry points' names."""
    files = []
    for entry in sorted(entries_of(LISTS), key=lambda entry: entry.name):
        spec = find_spec(entry.module)
        for folder in (spec.submodule_search_locations or ()) if spec else ():
            files.append(Path(folder) / entry.attr)
    return files


def known_renderers() -> Mapping[str, EntryPoint]:
    """Return every installed entry point of the groups, by name, in alphabetical order."""
    return by_name((*entries_of(FIELD), *entries_of(RENDERER_GROUP)))


def known_modifiers() -> Mapping[str, EntryPoint]:
    """Return every installed entry point of `MODIFIERS`, by name, in alphabetical order."""
    return by_name(entries_of(MODIFIERS))


def own_renderers() -> tuple[str, ...]:
    """Return the names that this distribution itself registers: what is run where no renderer is named."""
    return tuple(
        name
        for name, entry in known_renderers().items()
        if entry.group == RENDERER_GROUP and entry.dist is not None and entry.dist.name == DISTRIBUTION
    )


def resolve(name: str) -> RendererFactory:
    """Return the factory behind a renderer's name.

    Raises `UnknownNameError`, with the closest known ones, for a name, a scheme or a representation that is not known.

    Raises `InputError` for a module that cannot be imported, an attribute that it lacks or that cannot be called, and
    for a suffix on a factory that has no variants.
    """
    parts = parse(name)
    scheme, _, modifier = ("+" + (parts.regulation or "")).rpartition("+")
    if modifier in known_modifiers():
        module, _, attribute = known_modifiers()[modifier].value.partition(":")
        modify = _import_factory(modifier, module.strip(), attribute.strip(), "modifier")
        inner = f"{parts.base}{scheme}{'' if parts.representation is None else f'@{parts.representation}'}"
        return cast("RendererFactory", modify(resolve(inner)))
    factory = cast("RendererFactory", load(parts.base))
    # Most names have no suffix, and need not import what reads them.
    if parts.regulation is None and parts.representation is None:
        return factory
    from hapticeval.renderer import choices_of

    choices = choices_of(factory)
    if choices.variant is None:
        raise InputError(
            f"'{parts.base}' has no variants, so '{name}' names nothing",
            why="+SCHEME and @REPRESENTATION need a factory with variant(regulation=..., representation=...)",
            todo=f"use '{parts.base}' as it is",
        )
    chosen: dict[str, str] = {}
    for keyword, value, kind, offered in (
        ("regulation", parts.regulation, "regulation scheme", choices.regulations),
        ("representation", parts.representation, "representation", choices.representations),
    ):
        if value is not None:
            # A factory that does not list what it offers refuses by itself.
            if offered is not None and value not in offered:
                raise UnknownNameError(f"{kind} of {parts.base}", value, offered)
            chosen[keyword] = value
    with renderer_errors("variant()"):
        return choices.variant(**chosen)


def resolve_installed(name: str, *, source: str) -> RendererFactory:
    """Return the factory behind a name that a file gives, `source`: an installed entry point and nothing else.

    A file that is read never names code to run: that is for the command line. Raises `InputError` for a name of
    another kind, and as `resolve` does.
    """
    if parse(name).base not in known_renderers():
        raise InputError(
            f"{source} names the renderer '{name}', which is not installed",
            why="a file may name an installed renderer, and never code to import",
            todo=f"if you trust that code, name it yourself: -r {name}",
        )
    return resolve(name)


def load(base: str, *, kind: str = "renderer") -> Any:
    """Return what is called to make what `base` names: `package.module:factory`, or an entry point of renderers, or
    what is not Python, see `ADAPTERS`.

    `kind` is what it is in messages; a driver of hardware is named as renderers are. Raises as `resolve` does.
    """
    # Three kinds of names: an adapter's, package.module:factory, and an entry point.
    module, colon, attribute = base.partition(":")
    if colon and kind == "renderer" and module in ADAPTERS:
        place, _, name = ADAPTERS[module].partition(":")
        return getattr(import_module(place), name)(attribute)
    if colon or kind != "renderer":
        if not module or not attribute:
            raise InputError(
                f"'{base}' does not name a {kind}",
                why="package.module:factory needs a module before the colon and a factory after it",
            )
        see_current_directory()
    else:
        known = known_renderers()
        if base not in known:
            # A file in this folder that the name may mean is the better advice; else the closest known names.
            error = UnknownNameError("renderer", base, known)
            likely_names = _likely_names(base)
            error.todo = (
                f"did you mean {' or '.join(likely_names)}?"
                if likely_names
                else f"{error.todo}{'' if error.todo.endswith('?') else '.'} A renderer of your own is named "
                "package.module:factory"
            )
            raise error
        module, _, attribute = known[base].value.partition(":")
    return _import_factory(base, module.strip(), attribute.strip(), kind)


def _likely_names(base: str) -> list[str]:
    """Return names that were probably meant, where `base` is a file of this folder, as in `mine.py`, or a library."""
    # A library without a folder is looked for by the system's loader, hence the ./ before it.
    if Path(base).suffix in LIBRARY_ENDINGS:
        return [f"lib:{base if Path(base).parent.name or base.startswith(('.', '/')) else f'./{base}'}"]
    stem = base.removesuffix(".py").removeprefix("./")
    # `mine` as a module of its own, then `mine.Nearest` as a name in the module `mine`.
    for module, attribute in ((stem, ""), stem.rpartition(".")[::2]):
        file = Path(f"{module.replace('.', '/')}.py")
        if module and file.is_file():
            # The file is searched as text: no code runs before the user has named it.
            public = re.findall(r"^(?:class|def) ([^\W_]\w*)", file.read_text(encoding="utf-8", errors="replace"), re.M)
            return [f"{module}:{public_name}" for public_name in ([attribute] if attribute else public[:8])]
    return []


def _import_factory(base: str, module: str, attribute: str, kind: str) -> Any:
    """Import a factory, look it up, and see that it can be called; each failure says which step it was."""
    try:
        # Step 1: import the module; a module that calls sys.exit is caught too.
        target: Any = import_module(module)
    except (Exception, SystemExit) as error:
        todo = f"see that `python -c 'import {module}'` works in the folder where you start hapticeval"
        close = difflib.get_close_matches(module, [file.stem for file in Path().glob("*.py")], n=1)
        if close and close[0] != module:
            todo = f"did you mean {close[0]}:{attribute}?"
        raise InputError(
            f"{kind} '{base}': cannot import the module '{module}'",
            why=_describe_cause(error),
            todo=_advise_module(module, attribute) if module.endswith(".py") else todo,
        ) from error
    # Step 2: look the attribute up, which may be nested as in Class.method.
    for part in attribute.split("."):
        try:
            target = getattr(target, part)
        except AttributeError as error:
            callables = {
                name: value for name, value in vars(target).items() if not name.startswith("_") and callable(value)
            }
            # What the module itself defines is meant rather than what it imports.
            public = [name for name, value in callables.items() if getattr(value, "__module__", module) == module]
            close = difflib.get_close_matches(part, public, n=1)
            raise InputError(
                f"{kind} '{base}': the module '{module}' has no '{attribute}'",
                why=str(error),
                todo=f"did you mean {module}:{close[0]}?"
                if close
                else f"it has: {', '.join(public[:8] or callables)}"
                if callables
                else f"write it in {getattr(target, '__file__', module)}, where there is no class and no function yet",
            ) from error
    # Step 3: it must be callable.
    if not callable(target):
        takes = "a factory takes a scene and returns a renderer" if kind == "renderer" else "it must be a class"
        raise InputError(
            f"{kind} '{base}': '{attribute}' of '{module}' cannot be called",
            why=f"it is a {type(target).__name__}; {takes}",
        )
    return target


def _advise_module(file: str, attribute: str) -> str:
    """Advise to name a factory by its module, not by its file, and in which folder that can be imported."""
    path = Path(file)
    inside = Path.cwd() if path.is_absolute() else Path()
    # A module can be imported only from below the folder in which hapticeval starts.
    relative = path.relative_to(inside) if path.is_relative_to(inside) else path
    if relative.is_absolute() or ".." in relative.parts:
        return f"name the module, not its file: in {path.parent}, {path.stem}:{attribute}"
    return f"name the module, not its file: {'.'.join(relative.with_suffix('').parts)}:{attribute}"


def _describe_cause(error: BaseException) -> str:
    """Return the cause's own text, and the line of the user's file at which it was raised."""
    text = describe_error(error)
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if "importlib" not in frame.filename]
    # A syntax error names its line itself; one frame is this file's own, of a module that is not there.
    if isinstance(error, SyntaxError) or len(frames) < 2:
        return text
    return f"{text} ({frames[-1].filename}, line {frames[-1].lineno})"


def see_current_directory() -> None:
    """Let a module in the current directory be imported, as pytest and `python -m` do."""
    folder = str(Path.cwd())
    # An empty entry of sys.path stands for the current directory already.
    if folder not in sys.path and "" not in sys.path:
        sys.path.insert(0, folder)
