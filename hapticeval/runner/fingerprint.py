"""What the last digit of a number may depend on, on the machine that computes it: versions, code, and processor.

It is asked of machines that may lack a library: so it stands by itself, on the standard library.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import platform
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path

COMPUTING_LIBRARIES = ("numpy", "scipy", "numba", "llvmlite", "shapely", "h5py")


def fingerprint(files: Mapping[str, str]) -> dict[str, str]:
    """Return what a number computed here may depend on, by name: versions, the package's source, processor.

    Of `files`, digests by path, those are named that are missing or another here.
    """
    properties = {
        "python": platform.python_version(),
        "machine": platform.machine(),
        "libc": " ".join(platform.libc_ver()),
    }
    for name in ("hapticeval", *COMPUTING_LIBRARIES):
        try:
            properties[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            properties[name] = "none"
    # A version does not tell an edited checkout: the source itself counts.
    code = hashlib.sha256()
    for package in ("hapticeval", "hapticeval.renderers"):
        try:
            spec = importlib.util.find_spec(package)
        except ImportError:
            spec = None
        for folder in () if spec is None else spec.submodule_search_locations or ():
            for file in sorted(Path(folder).rglob("*.py")):
                code.update(str(file.relative_to(folder)).encode() + file.read_bytes())
    properties["code of hapticeval"] = code.hexdigest()[:12]
    properties.update(_processor())
    # Files that are the same leave no entry, so that alike machines have equal fingerprints.
    for path, digest in files.items():
        try:
            local_digest = hashlib.sha256(Path(path).read_bytes()).hexdigest()
        except OSError:
            local_digest = ""
        if local_digest != digest:
            properties[f"the file {path}"] = "another" if local_digest else "missing"
    return properties


def _processor() -> dict[str, str]:
    """Return for which processor kernels are compiled, and which of its instructions they and numpy use."""
    properties = {}
    try:
        import llvmlite.binding as llvm

        # These variables, where set, name the processor that numba compiles for: one for all of a mixed cluster.
        features = os.environ.get("NUMBA_CPU_FEATURES", llvm.get_host_cpu_features().flatten())
        properties["CPU"] = os.environ.get("NUMBA_CPU_NAME", llvm.get_host_cpu_name())
        properties["CPU features"] = hashlib.sha256(features.encode()).hexdigest()[:12]
    except ImportError:
        properties["CPU"] = "unknown"
    try:
        import numpy

        # numpy chooses its loops by these when it is imported.
        used = numpy.show_config(mode="dicts")["SIMD Extensions"]["found"]
        properties["CPU features of numpy"] = " ".join(used)
    except (ImportError, KeyError, TypeError):
        properties["CPU features of numpy"] = "unknown"
    return properties


def differences(ours: Mapping[str, str], theirs: Mapping[str, str]) -> list[str]:
    """Return what differs between another machine's fingerprint and ours: ["numpy 2.1.0 in place of 2.4.6"]."""
    names = dict.fromkeys((*ours, *theirs))
    return [
        f"{name} {theirs.get(name, 'none')}" + (f" in place of {ours[name]}" if name in ours else "")
        for name in names
        if ours.get(name) != theirs.get(name)
    ]
