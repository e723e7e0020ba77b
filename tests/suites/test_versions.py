"""Within a version no case of a suite asks something else: `digests.csv` holds what each asks (`suites/POLICY.md`)."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import msgspec
import pytest
from publishing import publishing

from hapticeval.suite.outline import find_suites
from hapticeval.suite.reading import load_suite
from hapticeval.suite.suite import digest_of_case

SUITES = [load_suite(name) for name in sorted(find_suites())]
RECORDED = Path(__file__).parents[2] / "suites" / "digests.csv"
CHANGELOG = RECORDED.with_name("CHANGELOG.md")


def current_digests() -> str:
    """The table as it would be written: suite, version, case, digest."""
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow(["suite", "version", "case", "digest"])
    for suite in SUITES:
        writer.writerows([suite.name, suite.version, case.name, digest_of_case(case)] for case in suite.cases)
    return table.getvalue()


def test_no_case_asks_something_else_than_recorded_within_a_version():
    if publishing():
        RECORDED.write_text(current_digests(), encoding="utf-8")
    recorded, current = ({*text.splitlines()} for text in (RECORDED.read_text(encoding="utf-8"), current_digests()))
    assert recorded ^ current == set(), "raise the suite's version and write the digests anew: see suites/POLICY.md"


@pytest.mark.parametrize("suite", SUITES, ids=lambda suite: suite.name)
def test_every_suite_of_ours_has_a_version(suite):
    assert suite.version


def changelog() -> str:
    """Write the page of what each version of each suite changed, newest first, of the suites' own `changes`."""
    rows = [
        f"- **{suite.name} {version}**: {words}"
        for suite in SUITES
        for version, words in reversed(suite.changes.items())
    ]
    return "\n".join(["# Versions of the suites", "", *rows, "- **1.0** of every suite: the first version.", ""])


def test_the_published_changelog_is_that_of_the_suites():
    if publishing():
        CHANGELOG.write_text(changelog(), encoding="utf-8")
    assert CHANGELOG.read_text(encoding="utf-8") == changelog()


@pytest.mark.parametrize("suite", SUITES, ids=lambda suite: suite.name)
def test_a_suite_says_what_its_version_changed(suite):
    assert suite.version == "1.0" or suite.changes.get(suite.version)


def test_a_digest_is_of_what_a_case_asks_and_not_of_its_words():
    case = load_suite("thesis").case("plane-press")
    digest = digest_of_case(case)
    assert digest_of_case(msgspec.structs.replace(case, title="another", shows="words", citation="1.1")) == digest
    assert digest_of_case(msgspec.structs.replace(case, published={"constraint": {"passivity": "pass"}})) == digest
    assert digest_of_case(msgspec.structs.replace(case, scene={**case.scene, "stiffness": 999.0})) != digest
    assert digest_of_case(msgspec.structs.replace(case, checks=case.checks[1:])) != digest


def test_a_digest_does_not_depend_on_where_the_suite_lies(tmp_path):
    nut = load_suite("solids").case("nut-rim")
    for file in Path(nut.folder).glob("solids*"):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    copied = load_suite(str(tmp_path / "solids.toml"))
    assert digest_of_case(copied.case("nut-rim")) == digest_of_case(nut)
    (tmp_path / "solids-nut.ply").write_bytes((tmp_path / "solids-pebble.ply").read_bytes())
    # another process reads the file anew; here the digest of a file is kept
    from hapticeval.suite import suite as suites

    suites._digest_of.cache_clear()
    assert digest_of_case(copied.case("nut-rim")) != digest_of_case(nut)
