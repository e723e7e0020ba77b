"""A plain page of a case: the verdicts of each renderer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from hapticeval.files import replacing
from hapticeval.recordings.recording import Recording
from hapticeval.reports.places import anchor, case_file
from hapticeval.reports.templates import environment, text_of
from hapticeval.runner.results import RunEntry, VerdictEntry

ASSETS = ("report.css",)


@dataclass(frozen=True)
class Around:
    home: tuple[str, str] | None = None
    before: tuple[str, str] | None = None
    after: tuple[str, str] | None = None


def write_case_page(folder: Path, case, entries, recordings, *, verdicts, order=(), around=None) -> Path:
    path = folder / case_file(*case)
    text = (
        "<!doctype html><html lang=en><title>case</title><link rel=stylesheet href=../../assets/report.css><main>"
        + case_section(case, entries, recordings, verdicts=verdicts)
        + "</main>"
    )
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path


def write_assets(folder: Path) -> None:
    for name in ASSETS:
        with replacing(folder / "assets" / name) as temporary:
            temporary.write_bytes(asset(name))


def asset(name: str) -> bytes:
    return text_of(name).encode()


def case_section(case, entries, recordings, *, verdicts, order=(), prefix="c") -> str:
    parts = [f'<h2 id="{anchor(*case)}">{entries[0].title}</h2>']
    for run in entries:
        parts.append(f'<h3 id="{anchor(*run.key)}">{run.renderer}</h3><ul>')
        parts += [
            f'<li id="{anchor(*run.key, v.check)}">{v.check} {v.outcome} {v.message}</li>'
            for v in verdicts.get(run.renderer, ())
        ]
        parts.append("</ul>")
    return "".join(parts)
