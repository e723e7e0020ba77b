"""Conformance and benchmarking for haptic renderers: six phenomena of rigid contact as automated checks.

The light value types are imported here. What needs compiled geometry (`Scene`, `Response` and what is built
on them) is imported on first use, so that `import hapticeval` stays quick.
"""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from hapticeval.errors import (
    HapticevalError,
    InputError,
    NothingSelectedError,
    RefusalError,
    RendererError,
    UnknownNameError,
)
from hapticeval.phenomena.verdict import Finding, Level, Metric, Outcome, Verdict
from hapticeval.recordings.recording import Recording
from hapticeval.stimulus.stimulus import Experiment, Path, Stimulus
from hapticeval.types import Array, BoolArray, IntArray

if TYPE_CHECKING:
    from hapticeval.api import Results, judge, run
    from hapticeval.discovery import known_renderers, resolve
    from hapticeval.geometry.catalogue import make_model
    from hapticeval.phenomena.check import Check, Runs
    from hapticeval.recordings.hdf5 import read_recording
    from hapticeval.renderer import Batch, Declaration, Renderer, RendererFactory, Response, Spring, TrajectoryRenderer
    from hapticeval.scene import Scene
    from hapticeval.suite.reading import load_suite

__version__ = version("hapticeval")

_LAZY = {
    "Batch": "hapticeval.renderer",
    "Check": "hapticeval.phenomena.check",
    "Declaration": "hapticeval.renderer",
    "Renderer": "hapticeval.renderer",
    "RendererFactory": "hapticeval.renderer",
    "Response": "hapticeval.renderer",
    "Results": "hapticeval.api",
    "Runs": "hapticeval.phenomena.check",
    "Scene": "hapticeval.scene",
    "TrajectoryRenderer": "hapticeval.renderer",
    "Spring": "hapticeval.renderer",
    "judge": "hapticeval.api",
    "known_renderers": "hapticeval.discovery",
    "load_suite": "hapticeval.suite.reading",
    "make_model": "hapticeval.geometry.catalogue",
    "read_recording": "hapticeval.recordings.hdf5",
    "resolve": "hapticeval.discovery",
    "run": "hapticeval.api",
}

__all__ = [
    "Array",
    "Batch",
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
    "Recording",
    "RefusalError",
    "Renderer",
    "RendererError",
    "RendererFactory",
    "Response",
    "Results",
    "Runs",
    "Scene",
    "Spring",
    "Stimulus",
    "TrajectoryRenderer",
    "UnknownNameError",
    "Verdict",
    "__version__",
    "judge",
    "known_renderers",
    "load_suite",
    "make_model",
    "read_recording",
    "resolve",
    "run",
]


def __getattr__(name: str) -> Any:
    """Import a heavy name on its first use (PEP 562)."""
    if name not in _LAZY:
        raise AttributeError(f"module 'hapticeval' has no attribute '{name}'")
    return getattr(import_module(_LAZY[name]), name)
