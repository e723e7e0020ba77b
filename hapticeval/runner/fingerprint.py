"""What the last digit of a number may depend on, on the machine that computes it: versions, code, and processor.

It is asked of machines that may have another hapticeval, or none: so it stands by itself, on the standard library.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import platform
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path

LIBRARIES = ("numpy", "scipy", "numba", "llvmlite", "shapely", "h5py")


def fingerprint(files: Mapping[str, str]) -> dict[str, str]:
    """Return what this process computes with, a text each; of `files`, digests by path, those that are other here."""
    found = {"python": platform.python_version(), "machine": platform.machine(), "libc": " ".join(platform.libc_ver())}
    for name in ("hapticeval", *LIBRARIES):
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "none"
    code = hashlib.sha256()
    for package in ("hapticeval", "hapticeval.renderers"):
        try:
            spec = importlib.util.find_spec(package)
        except ImportError:
            spec = None
        for folder in () if spec is None else spec.submodule_search_locations or ():
            for file in sorted(Path(folder).rglob("*.py")):
                code.update(str(file.relative_to(folder)).encode() + file.read_bytes())
    found["code of hapticeval"] = code.hexdigest()[:12]
    found.update(_processor())
    for path, digest in files.items():
        try:
            here = hashlib.sha256(Path(path).read_bytes()).hexdigest()
        except OSError:
            here = ""
        if here != digest:
            found[f"the file {path}"] = "another" if here else "missing"
    return found


def _processor() -> dict[str, str]:
    """Return for which processor kernels are compiled, and which of its instructions they and numpy use."""
    found = {}
    try:
        import llvmlite.binding as llvm

        features = os.environ.get("NUMBA_CPU_FEATURES", llvm.get_host_cpu_features().flatten())
        found["CPU"] = os.environ.get("NUMBA_CPU_NAME", llvm.get_host_cpu_name())
        found["CPU features"] = hashlib.sha256(features.encode()).hexdigest()[:12]
    except ImportError:
        found["CPU"] = "unknown"
    try:
        import numpy

        used = numpy.show_config(mode="dicts")["SIMD Extensions"]["found"]
        found["CPU features of numpy"] = " ".join(used)
    except (ImportError, KeyError, TypeError):
        found["CPU features of numpy"] = "unknown"
    return found


def unlike(here: Mapping[str, str], there: Mapping[str, str]) -> list[str]:
    """Return in what another machine's fingerprint differs from ours: ["numpy 2.1.0 in place of 2.4.6"]."""
    names = dict.fromkeys((*here, *there))
    return [
        f"{name} {there.get(name, 'none')}" + (f" in place of {here[name]}" if name in here else "")
        for name in names
        if here.get(name) != there.get(name)
    ]
