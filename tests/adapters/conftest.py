"""Libraries that are built by the system's compiler: without one these tests are skipped."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from hapticeval.adapters.library import HEADER

EXAMPLES = Path(__file__).parents[2] / "examples"

PLANE = """
#include <math.h>
#include <stdlib.h>
#include <stdio.h>
#include "hapticeval.h"
/* Keeps the hand above y = 0, and counts what it is asked. */
typedef struct { double stiffness; int n, ticks; FILE *log; } made;
#ifndef ABI
#define ABI HR_ABI
#endif
#ifndef FLAGS
#define FLAGS HR_PLANE
#endif
uint32_t hr_abi(void) { return ABI; }
int32_t hr_info_get(const void *self, hr_info *info) { INFO; if (!self) info->flags = FLAGS; return 0; }
int32_t hr_create(const hr_scene *scene, void **self, char *why, uint32_t n) {
  made *m = calloc(1, sizeof *m);
  m->stiffness = scene->stiffness; m->n = (int)scene->dimension; *self = m;
  (void)why; (void)n;
  CREATE;
  return 0;
}
int32_t hr_reset(void *self, const double *hip, const double *tool) {
  (void)self, (void)hip, (void)tool;
  RESET;
  return 0;
}
int32_t hr_step(void *self, const double *hip, const double *velocity, double dt, double *ihip, double *force) {
  made *m = self;
  (void)velocity; (void)dt;
  m->ticks++;
  STEP;
  for (int i = 0; i < m->n; i++) { ihip[i] = hip[i]; force[i] = 0; }
  if (hip[1] >= 0) return HR_FREE;
  ihip[1] = 0; force[1] = -m->stiffness * hip[1];
  return HR_CONTACT;
}
#ifndef KEEP
void hr_destroy(void *self) { free(self); DESTROY; }
#endif
"""


@pytest.fixture(scope="session")
def compiler() -> str:
    found = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if found is None:
        pytest.skip("no C compiler")
    return found


@pytest.fixture(scope="session")
def build(compiler: str, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Build PLANE with code put into it, once for the same; return the library."""
    made: dict[tuple[tuple[str, str], ...], Path] = {}

    def built(**code: str) -> Path:
        key = tuple(sorted(code.items()))
        if key not in made:
            folder = tmp_path_factory.mktemp("library")
            given = {"INFO": "", "CREATE": "", "RESET": "", "STEP": "", "DESTROY": "", **code}
            head = "".join(f"#define {name} {text}\n" for name, text in given.items())
            (folder / "plane.c").write_text(head + PLANE)
            made[key] = folder / "libplane.so"
            command = [compiler, "-std=c99", "-shared", "-fPIC", f"-I{HEADER.parent}", "-o", "libplane.so", "plane.c"]
            subprocess.run([*command, "-lm"], cwd=folder, check=True)
        return made[key]

    return built


@pytest.fixture(scope="session")
def penalty(compiler: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example in C."""
    folder = tmp_path_factory.mktemp("penalty")
    flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", f"-I{HEADER.parent}"]
    file = folder / "libpenalty.so"
    subprocess.run([compiler, *flags, "-o", str(file), str(EXAMPLES / "c" / "penalty.c"), "-lm"], check=True)
    return file


@pytest.fixture(scope="session")
def god_object(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example in C++."""
    found = shutil.which("c++") or shutil.which("g++") or shutil.which("clang++")
    if found is None:
        pytest.skip("no C++ compiler")
    file = tmp_path_factory.mktemp("god-object") / "libgod_object.so"
    flags = ["-std=c++17", "-O2", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", f"-I{HEADER.parent}"]
    subprocess.run([found, *flags, "-o", str(file), str(EXAMPLES / "cpp" / "god_object.cpp")], check=True)
    return file
