"""What a texture holds, and a model file of the public toolkit as one of ours.

Run it as `python -m hapticeval.examples.studies.texture ribbed`.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from hapticeval.cli import run_program
from hapticeval.commands.arguments import argument, option
from hapticeval.commands.terminal import lines, say, wrote_lines
from hapticeval.effects.texture import Texture, as_document, autocovariance, named, read_texture
from hapticeval.effects.texture_toolkit import read_toolkit
from hapticeval.errors import InputError
from hapticeval.files import creating

TEXTURE_CODES = """\b
Exit codes:
  0  shown, or written
  2  wrong usage or input: the message says what, why, and what to do
"""


def texture(
    file: Annotated[
        str,
        argument(metavar="TEXTURE", help="One of ours by its name, a TOML file of one, or a toolkit's .xml file."),
    ],
    output: Annotated[
        Path | None, option("-o", "--output", metavar="FILE", help="The texture as a TOML file, which suites may name.")
    ] = None,
    rate: Annotated[
        float | None,
        option("--rate", metavar="HZ", help="Samples a second that an .xml file's frequencies are for."),
    ] = None,
) -> None:
    """Show the filters of a texture, and write it as the TOML file that a suite's stochastic-texture may name.

    Model files of the Penn Haptic Texture Toolkit are read too. They do not say for which rate their frequencies were
    computed: 10000 as measured, or what they were resampled to, which has to be the scene's. Their licence forbids to
    pass them on, and so what is made of them.

    \b
    Examples:
      python -m hapticeval.examples.studies.texture ribbed
      python -m hapticeval.examples.studies.texture "Models_ABS Plastic.xml" --rate 1000 -o abs.toml
    """
    path = Path(file)
    if path.suffix == ".xml":
        if rate is None:
            raise InputError(
                f"{file} does not give its rate",
                why="line spectral frequencies are angles a sample",
                todo="give --rate: 10000 as measured, or what the model was resampled to",
            )
        source = read_toolkit(path, rate=rate)
    elif rate is not None:
        raise InputError("--rate with a texture of ours", why="it holds its own", todo="leave --rate out")
    else:
        source = read_texture(path) if path.suffix == ".toml" else named(file)
    # Poles and zeros are shown of the first filter.
    first = source.filters[0]
    friction = "no friction" if source.friction is None else f"friction {source.friction:g}"
    say(
        f"{source.title}: {len(source.filters)} filters of {len(first.ar)} poles and {len(first.ma)} zeros for "
        f"{source.rate:g} Hz, in {len(source.corners())} triangles; {friction}"
    )
    say(
        lines(
            # The variance is the autocovariance at lag 0; its root is the rms.
            f"{model.speed:8.4g} m/s {model.force:8.4g} N   rms {math.sqrt(autocovariance(model, 1)[0]):.4g} m/s^2"
            for model in sorted(source.filters, key=lambda model: (model.speed, model.force))
        )
    )
    if output is not None:
        with creating(output) as temporary:
            temporary.write_text(as_toml(source), encoding="utf-8")
        say(wrote_lines([output]))


def as_toml(source: Texture) -> str:
    """Return a texture as the text of a TOML file that `read_texture` reads, to the last bit."""
    document = as_document(source)
    filters = document.pop("filters")
    text_lines = [f"{name} = {_value(value)}" for name, value in document.items()]
    for filter_ in filters:
        values = [f"{name} = {_value(value)}" for name, value in filter_.items() if value != []]
        text_lines += ["", "[[filters]]", *values]
    return "\n".join(text_lines) + "\n"


def _value(value: Any) -> str:
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return repr(value)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program and return its exit code."""
    return run_program(texture, TEXTURE_CODES, arguments)


if __name__ == "__main__":
    sys.exit(main())
