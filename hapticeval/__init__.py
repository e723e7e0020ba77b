"""Conformance and benchmarking for haptic renderers: six phenomena of rigid contact as automated checks.

Each name is imported on first use, so that `import hapticeval` costs nothing: pytest's plugin is imported in every run
of pytest.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hapticeval.api import Results, judge, plot_document, run
    from hapticeval.discovery import known_renderers, resolve
    from hapticeval.errors import (
        HapticevalError,
        InputError,
        NothingSelectedError,
        RefusalError,
        RendererError,
        UnknownNameError,
    )
    from hapticeval.geometry.catalogue import make_model
    from hapticeval.hardware.device import Reading
    from hapticeval.phenomena.check import Check, Runs
    from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome, Verdict, compared, undecided
    from hapticeval.recordings.hdf5 import read_recording
    from hapticeval.recordings.recording import Recording
    from hapticeval.renderer import AtRest, Declaration, Renderer, RendererFactory, Response, Spring, TrajectoryRenderer
    from hapticeval.runner.planning import RunOptions
    from hapticeval.runner.results import results_schema
    from hapticeval.scene import Scene
    from hapticeval.stimulus.stimulus import Experiment, Path, Stimulus
    from hapticeval.strategies import hand_paths
    from hapticeval.suite.reading import load_suite
    from hapticeval.types import Array, BoolArray, IntArray

    __version__: str

_LAZY = {
    "Array": "hapticeval.types",
    "AtRest": "hapticeval.renderer",
    "BoolArray": "hapticeval.types",
    "Check": "hapticeval.phenomena.check",
    "Declaration": "hapticeval.renderer",
    "Experiment": "hapticeval.stimulus.stimulus",
    "Finding": "hapticeval.phenomena.verdict",
    "HapticevalError": "hapticeval.errors",
    "InputError": "hapticeval.errors",
    "IntArray": "hapticeval.types",
    "Level": "hapticeval.phenomena.verdict",
    "Metric": "hapticeval.phenomena.verdict",
    "NothingSelectedError": "hapticeval.errors",
    "Outcome": "hapticeval.phenomena.verdict",
    "Path": "hapticeval.stimulus.stimulus",
    "Reading": "hapticeval.hardware.device",
    "Recording": "hapticeval.recordings.recording",
    "RefusalError": "hapticeval.errors",
    "Renderer": "hapticeval.renderer",
    "RendererError": "hapticeval.errors",
    "RendererFactory": "hapticeval.renderer",
    "Response": "hapticeval.renderer",
    "Results": "hapticeval.api",
    "RunOptions": "hapticeval.runner.planning",
    "Runs": "hapticeval.phenomena.check",
    "Scene": "hapticeval.scene",
    "Spring": "hapticeval.renderer",
    "Stimulus": "hapticeval.stimulus.stimulus",
    "TrajectoryRenderer": "hapticeval.renderer",
    "UnknownNameError": "hapticeval.errors",
    "Verdict": "hapticeval.phenomena.verdict",
    "compared": "hapticeval.phenomena.verdict",
    "hand_paths": "hapticeval.strategies",
    "judge": "hapticeval.api",
    "plot_document": "hapticeval.api",
    "known_renderers": "hapticeval.discovery",
    "load_suite": "hapticeval.suite.reading",
    "make_model": "hapticeval.geometry.catalogue",
    "read_recording": "hapticeval.recordings.hdf5",
    "resolve": "hapticeval.discovery",
    "results_schema": "hapticeval.runner.results",
    "run": "hapticeval.api",
    "undecided": "hapticeval.phenomena.verdict",
}

__all__ = [
    "Array",
    "AtRest",
    "BoolArray",
    "Check",
    "Declaration",
    "Experiment",
    "Finding",
    "HapticevalError",
    "InputError",
    "IntArray",
    "Level",
    "Metric",
    "NothingSelectedError",
    "Outcome",
    "Path",
    "Reading",
    "Recording",
    "RefusalError",
    "Renderer",
    "RendererError",
    "RendererFactory",
    "Response",
    "Results",
    "RunOptions",
    "Runs",
    "Scene",
    "Spring",
    "Stimulus",
    "TrajectoryRenderer",
    "UnknownNameError",
    "Verdict",
    "__version__",
    "compared",
    "hand_paths",
    "judge",
    "known_renderers",
    "load_suite",
    "make_model",
    "plot_document",
    "read_recording",
    "resolve",
    "results_schema",
    "run",
    "undecided",
]


def __dir__() -> list[str]:
    """Return the public names, whether or not they were imported yet."""
    return __all__


def __getattr__(name: str) -> Any:
    """Import a name on its first use (PEP 562)."""
    # Reading the package's metadata is slow next to this import: only who asks for the version pays for it.
    if name == "__version__":
        return import_module("importlib.metadata").version("hapticeval")
    # The message is as Python's own: `hasattr` and `from ... import` rely on the type.
    if name not in _LAZY:
        raise AttributeError(f"module 'hapticeval' has no attribute '{name}'")
    return getattr(import_module(_LAZY[name]), name)
