"""TOML documents that people write, held to a JSON schema, with errors that name the table."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from difflib import get_close_matches
from importlib import resources
from pathlib import Path
from typing import Any

from hapticeval.errors import InputError


def read_document(file: Path, schema: str) -> Mapping[str, Any]:
    """What a TOML file holds, if it fits the package's `schema`.

    Raises `InputError`, naming the file and the place in it, for what is not TOML and for what does not fit.
    """
    try:
        document = tomllib.loads(file.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{file.name} is not TOML", why=str(error)) from error
    _validate(document, file.name, schema)
    return document


def _validate(document: Mapping[str, Any], file: str, schema: str) -> None:
    import jsonschema

    text = resources.files("hapticeval").joinpath(schema).read_text(encoding="utf-8")
    error = jsonschema.exceptions.best_match(jsonschema.Draft202012Validator(json.loads(text)).iter_errors(document))
    if error is None:
        return
    error = _of_the_kind(error)
    place = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in error.absolute_path)
    path = list(error.absolute_path)
    if len(path) >= 2 and path[0] == "case":
        name = document["case"][path[1]].get("name", f"number {path[1]}")
        place = f" case '{name}'" + "".join(f".{part}" for part in path[2:])
    raise InputError(
        f"{file}:{place or ' the file'} does not fit: {error.message}",
        todo=_meant(error) or "see docs/suites.md and docs/robots.md",
    )


def _meant(error: Any) -> str:
    """The names that are closest to one that is not known here."""
    if error.validator != "additionalProperties" or "properties" not in error.schema:
        return ""
    known = error.schema["properties"]
    close = [name for each in error.instance if each not in known for name in get_close_matches(each, known, n=2)]
    return f"did you mean {' or '.join(close)}?" if close else f"known here: {', '.join(known)}"


def _of_the_kind(error: Any) -> Any:
    """Of the ways in which a table fits none of several kinds, the one about the kind that it says it is."""
    if error.validator != "oneOf" or not isinstance(error.instance, dict) or "kind" not in error.instance:
        return error
    wrong_kind = {part.schema_path[0] for part in error.context if list(part.relative_path) == ["kind"]}
    of_its_kind = [part for part in error.context if part.schema_path[0] not in wrong_kind]
    # A misspelt name is both unknown and missing: the unknown one is what the user wrote.
    of_its_kind.sort(key=lambda part: part.validator != "additionalProperties")
    return of_its_kind[0] if of_its_kind else error
