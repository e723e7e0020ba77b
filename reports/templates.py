"""The templates of the pages, how numbers, names and scenes are written in them, and words a newcomer cannot know."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from functools import cache
from html import escape
from types import MappingProxyType
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from hapticeval.devices.parallelogram import constant_unit
from hapticeval.effects.catalogue import make_effect
from hapticeval.effects.effect import Stage
from hapticeval.files import file_stem
from hapticeval.quantity import format_duration, format_length, format_number, format_quantity, format_size, plural
from hapticeval.reports.grid import headline, is_sound, phenomenon_grid, step_ratio
from hapticeval.reports.table import provenance, ran_words, renderers_by_commit
from hapticeval.runner.results import Measure, RunEntry, SceneEntry
from hapticeval.runner.standing import Standing

if TYPE_CHECKING:
    from jinja2 import Environment


PAGES_FOLDER = "report"
"""The folder of the pages, beside results.json."""

INDEX = "index.html"
CHECK_PAGES = "checks.html"
ASSETS_FOLDER = "assets"
"""The first page, the page of what checks ask, and the folder of what all pages share, below `PAGES_FOLDER`."""

PATH_TO_PAGES = "../../"
"""From the page of a case to `PAGES_FOLDER`."""


def anchor(*names: str) -> str:
    """Return the id of `renderer/check` on the page of a case, of `suite/case/renderer/check` on that of all."""
    # Quoted as in a URL, so that the link and the id are the same text.
    return "/".join(quote(name, safe="@+:,~", errors="surrogatepass") for name in names)


def case_file(suite: str, case: str) -> str:
    """Return the path of a case's page below `PAGES_FOLDER`."""
    return f"cases/{file_stem(suite)}/{file_stem(case)}.html"


GLOSSARY: Mapping[str, str] = MappingProxyType(
    {
        "HIP": "haptic interface point: where the hand is, which may be inside the model",
        "IHIP": "ideal haptic interface point: where the renderer puts the tool, on the surface; others call it proxy "
        "or god-object",
        "unexpected": "not as expected: a check that must pass fails or cannot decide, the renderer breaks, or the "
        "outcome is not the published one; with --strict also a warning, and a listed failure that passes now. A "
        "known or an inherent failure is expected",
        "as expected": "the published outcome; where none is published, whatever stops no gate: a pass, a failure that "
        "is known or inherent, a warning",
        "inherent": "a failure that follows by a theorem from what the renderer declares to be, such as a spring or "
        "free of memory",
        "known": "a failure that a list of known failures has, with the reason",
        "pop-through": "the tool jumps to a distant part of the surface while the hand hardly moves",
        "n_pre": "the outward normal of the face that was touched before the corner",
        "depths": "penetration depths: of a length, how many times the distance from HIP to IHIP it is",
        "medial axis": "the points inside a model with more than one nearest point on its surface",
        "margin": "what is left of a bound: the bound less what was measured",
        "standoff": "how far from the surface a renderer declares to keep its tool",
    }
)
"""What a word means, in one line."""

WHOLE = re.compile(
    r"(<(?P<element>script|style|svg|title|select|button|abbr|dfn|code)\b.*?</(?P=element)>|<[^>]*>)", re.DOTALL
)
"""What is not running text in a page: tags, and elements in which no word is explained."""

GLOSSARY_WORD = re.compile(rf"(?<![\w-])({'|'.join(map(re.escape, GLOSSARY))})(?![\w-])")


def explain_terms(page: str) -> str:
    """Return a page of HTML in which each word of `GLOSSARY` is an `<abbr>` with its meaning where it first stands."""
    explained: set[str] = set()

    def explanation(match: re.Match[str]) -> str:
        word = match[0]
        if word in explained:
            return word
        explained.add(word)
        return f'<abbr title="{escape(GLOSSARY[word], quote=True)}">{word}</abbr>'

    parts: list[str] = []
    end = 0
    for markup in WHOLE.finditer(page):
        parts += [GLOSSARY_WORD.sub(explanation, page[end : markup.start()]), markup[0]]
        end = markup.end()
    return "".join([*parts, GLOSSARY_WORD.sub(explanation, page[end:])])


MOST_CHARACTERS = 120
"""Characters of a model's parameters above which only its kind is named: an imported outline has thousands."""


@cache
def environment() -> Environment:
    """Return jinja's environment: everything is escaped, but for what the filter `svg` lets through as it is."""
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    # An undefined name in a template is an error, not an empty text.
    jinja = Environment(
        loader=PackageLoader("hapticeval.reports", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    jinja.filters |= {
        # A zero-width space lets a browser break a long name there.
        "breakable": lambda name: name.replace("+", "+\u200b").replace("@", "\u200b@").replace("/", "/\u200b"),
        "json_text": _json_text,
        "bytes": format_size,
        "duration": format_duration,
        "in_unit": format_length,
        "measure": _measure,
        "millimetres": _millimetres,
        "number": format_number,
        "plural": plural,
        "quantity": format_quantity,
        "evidence_text": _evidence_text,
        "small_length": _small_length,
        "step_ratio": step_ratio,
        "svg": Markup,
    }
    jinja.globals |= {
        "Standing": Standing,
        "anchor": anchor,
        "case_file": case_file,
        "check_page": CHECK_PAGES,
        "evidence_words": evidence_words,
        "figures_cited": figures_cited,
        "glossary": GLOSSARY,
        "headline": headline,
        "is_sound": is_sound,
        "model_words": model_words,
        "phenomenon_grid": phenomenon_grid,
        "provenance": provenance,
        "ran_words": ran_words,
        "renderers_by_commit": renderers_by_commit,
        "robot_words": robot_words,
        "root": PATH_TO_PAGES,
        "index": INDEX,
        "scene_words": scene_words,
        "assets": ASSETS_FOLDER,
    }
    return jinja


def model_words(run: RunEntry) -> str:
    """Return the model in a few words."""
    words = ", ".join(f"{name} {_json_text(value)}" for name, value in run.model_parameters.items())
    kind = str(run.model["kind"])
    return f"{kind} ({words})" if 0 < len(words) < MOST_CHARACTERS else kind


GAIN_UNITS = {"stiffness": "N/m", "damping": "N s/m", "mass": "kg", "restitution": ""}
"""A scene's gains and their units."""

INNER_LOOPS = {
    "static": "static inner loop, torques Jᵀ F (2.8)",
    "compensated": "inner loop with dynamic compensation (2.11)",
    "linearised": "inner loop by feedback linearisation (6.7)",
}
"""Inner loops in words, with the thesis's equation."""

SURFACE_STAGES = (None, Stage.ANSWER)
"""Stages of the surface's effects."""

CITED_FIGURES = re.compile(r"Figures? \d+\.\d+(?:(?:,| and| to) \d+\.\d+)*")
"""One citation of figures, as in Figure 6.5, Figures 6.3 to 6.5, or Figures 6.22 and 7.3."""


def scene_words(run: RunEntry) -> str:
    """The scene of a run document in one line, every number with its unit."""
    scene = run.scene
    # A gain of zero is not part of the scene.
    words = [
        f"{name} {format_quantity(getattr(scene, name), unit)}"
        for name, unit in GAIN_UNITS.items()
        if getattr(scene, name)
    ]
    words += _effects(scene, of_surface=True)
    if scene.sampling_time:
        words.append(format_quantity(1.0 / scene.sampling_time, "Hz"))
    return ", ".join([*words, "bilateral" if scene.bilateral else "unilateral"])


def robot_words(run: RunEntry) -> str:
    """The device of an experiment, its dynamics, inner loop and imperfections, in one line; "" where none is told."""
    scene = run.scene
    device = scene.device
    if device is None:
        return ""
    words = [device.kind]
    # The robot with a locked base has constant inertia: neither choice makes any difference to it.
    if device.kind == "parallelogram-3dof":
        dynamics = {"lagrangian": "Lagrangian dynamics", "printed": "dynamics as printed (2.26)"}
        words += [dynamics.get(device.dynamics or "", device.dynamics or ""), f"d₀ with {device.base_inertia}² x₃"]
    words += [f"{name} = {format_quantity(value, constant_unit(name))}" for name, value in device.constants.items()]
    if device.turning and scene.inner_loop is not None:
        words.append(INNER_LOOPS[scene.inner_loop])
    wrong = _effects(scene, of_surface=False)
    return f"{', '.join(words)}; {', '.join(wrong) if wrong else 'no imperfections'}"


def _effects(scene: SceneEntry, *, of_surface: bool) -> list[str]:
    """Describe each effect that the scene calls for, of the surface or of the robot."""
    turning = scene.device is not None and scene.device.turning
    effects = (make_effect(effect) for effect in scene.effects)
    return [effect.describe(turning=turning) for effect in effects if (effect.stage in SURFACE_STAGES) == of_surface]


def figures_cited(run: RunEntry) -> str:
    """The figures of the thesis that a case's citation names, for instance "Figures 6.22 and 7.3"; "" for none."""
    cited = [citation.split(" ", 1)[1] for citation in CITED_FIGURES.findall(run.citation or "")]
    if not cited:
        return ""
    # Also one entry may name several, as "6.3 to 6.5".
    several = len(cited) > 1 or not re.fullmatch(r"\d+\.\d+", cited[0])
    return f"Figure{'s' if several else ''} {' and '.join(cited)}"


EVIDENCE_UNITS: Mapping[str, tuple[str, float]] = MappingProxyType(
    {
        "m_s2": ("m/s²", 1.0),
        "m_s": ("m/s", 1.0),
        "N_s": ("N s", 1.0),
        "Ns": ("N s", 1.0),
        "kg_s": ("kg/s", 1.0),
        "N_m": ("N/m", 1.0),
        "1_s": ("1/s", 1.0),
        "m": ("mm", 1e3),
        "s": ("s", 1.0),
        "N": ("N", 1.0),
        "J": ("mJ", 1e3),
        "ms": ("ms", 1.0),
        "time": ("s", 1.0),
        "deg": ("°", 1.0),
        "rad": ("rad", 1.0),
        "dB": ("dB", 1.0),
        "Hz": ("Hz", 1.0),
    }
)
"""How names of evidence end; the unit that pages show it in, that of the verdict's words, and how many make one."""

POINT_NAMES = re.compile("(to_)?i?hip(_before|_other_path)?")
"""Names of evidence that are points, in m."""


def _evidence_unit(name: str) -> tuple[str, str, float]:
    """Return how a name of evidence ends, the unit that this means, and how many of it make one; "", "", 1 if none."""
    if POINT_NAMES.fullmatch(name):
        return "", *EVIDENCE_UNITS["m"]
    # EVIDENCE_UNITS has compound endings first: a name in _m_s ends in _s as well.
    end = next((suffix for suffix in EVIDENCE_UNITS if name.endswith(f"_{suffix}")), "")
    return end, *EVIDENCE_UNITS.get(end, ("", 1.0))


def evidence_words(name: str) -> str:
    """Return a name of evidence in words, with the unit it is shown in: `foot_speed_m_s` is the foot speed (m/s)."""
    end, unit, _ = _evidence_unit(name)
    words = name if end == "time" else name.removesuffix(f"_{end}")
    words = re.sub("i?hips?", lambda match: match[0].upper().replace("S", "s"), words.replace("_", " "))
    return f"{words} ({unit})" if unit else words


def _evidence_text(value: Any, name: str = "") -> str:
    """Return evidence of a name as a table shows it: numbers to four digits in its unit, lists without brackets."""
    # Before numbers: a bool is an int in Python.
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        # A minus as wide as a plus.
        return format_number(_evidence_unit(name)[2] * value).replace("-", "\u2212")
    if isinstance(value, list):
        return ", ".join(_evidence_text(part, name) for part in value)
    if isinstance(value, dict):
        return "; ".join(f"{key}: {_evidence_text(part, name)}" for key, part in value.items())
    return "–" if value is None else str(value)  # noqa: RUF001


def _measure(value: float | None, metric: Measure) -> str:
    """Return a metric or its bound in the unit of the check's words: energies in mJ, shares in per cent."""
    if value is not None and metric.unit == "J":
        return format_quantity(1e3 * value, "mJ")
    if value is not None and metric.unit in ("", "1") and metric.name.startswith("share"):
        return format_quantity(100.0 * value, "%")
    return format_quantity(value, metric.unit)


def _json_text(value: Any) -> str:
    """Return a value as JSON text, numbers to six digits."""
    if isinstance(value, str):
        return value
    # Through JSON, which reaches the numbers at any depth.
    rounded = json.loads(json.dumps(value), parse_float=lambda text: float(f"{float(text):.6g}"))
    return json.dumps(rounded, ensure_ascii=False)


def _millimetres(metres: float | None) -> str:
    """Return a length in mm to a nanometre; what rounds to zero has no sign."""
    if metres is None:
        return "not finite"
    text = f"{1e3 * metres:.6f}"
    # "-0.000000" rounds to zero and loses its sign.
    return text.removeprefix("-") if not float(text) else text.replace("-", "−")  # noqa: RUF001


def _small_length(metres: float | None) -> str:
    """Return a length with the unit that suits it, from m down to pm: a tolerance may be far below a millimetre."""
    if metres is None or not 0.0 < metres < 1e-4:
        return format_quantity(metres, "m")
    unit, scale = next(
        ((unit, scale) for unit, scale in (("µm", 1e6), ("nm", 1e9)) if metres * scale >= 1.0), ("pm", 1e12)
    )
    return format_quantity(metres * scale, unit)
