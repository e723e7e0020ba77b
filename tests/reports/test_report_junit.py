import xml.etree.ElementTree as ET

from reports_synthetic import HOSTILE, synthetic_results

from hapticeval.reports import junit
from hapticeval.reports.table import renderers


def parsed(results):
    return ET.fromstring(junit(results))


def cases(root, renderer="plain", case="lobe"):
    return {
        each.get("name").partition(" [")[0]: each
        for each in root.iter("testcase")
        if each.get("classname") == f"synthetic.{case}" and each.get("name").endswith(f"[{renderer}]")
    }


def kinds(case):
    return [child.tag for child in case]


def test_a_suite_for_each_suite_and_renderer_and_unique_names(results):
    root = parsed(results)
    assert [suite.get("name") for suite in root] == [f"synthetic: {name}" for name in renderers(results)]
    names = [(case.get("classname"), case.get("name")) for case in root.iter("testcase")]
    assert len(names) == len(set(names)) == len(results.verdicts) + 1


def test_a_failure_is_exactly_what_is_not_as_expected(results):
    found = cases(parsed(results))
    assert {name: kinds(case) for name, case in found.items()} == {
        "continuous-contact": ["system-out"],
        "contact-normal-force": ["failure"],
        "centripetal-force": ["skipped"],
        "memoryless": ["system-out"],
        "broken-contact": ["failure"],
        "impulsive-collision": ["skipped"],
    }
    assert found["continuous-contact"][0].text.startswith("fails, as known: pop-through <here>")
    assert found["broken-contact"][0].get("message") == "pop-through <here> (IHIP jump 40 mm, bound 1 mm)"
    assert found["contact-normal-force"][0].get("message").startswith("pass, published fail: ")
    assert (
        found["centripetal-force"][0].get("message")
        == "warning: inconclusive: too slow | to say (share not finite, bound 0.1)"
    )


def test_a_warning_fails_where_the_run_was_strict(results):
    strict = cases(parsed(synthetic_results(command={**results.command, "strict": True})))
    assert kinds(strict["centripetal-force"]) == ["failure"]
    assert kinds(strict["impulsive-collision"]) == ["skipped"]


def test_an_inconclusive_verdict_that_is_published_as_pass_is_no_skip(results):
    verdicts = [dict(each) for each in results.verdicts]
    verdicts[2] |= {"published": "pass", "as_expected": False}
    assert kinds(cases(parsed(synthetic_results(verdicts=verdicts)))["centripetal-force"]) == ["failure"]


def test_errors_are_errors_with_and_without_a_verdict(results):
    root = parsed(results)
    assert kinds(cases(root, "broken")["continuous-contact"]) == ["error"]
    lost = cases(root, "plain", "tip")["run"]
    assert kinds(lost) == ["error"]
    assert lost[0].get("message") == "it raised <ValueError> at tick 7"
    assert "\x1b" not in junit(results)
    assert "mend it" in lost[0].text
    assert HOSTILE in root[2].get("name")


def test_the_counts_add_up(results):
    root = parsed(results)
    for name, tag in (("tests", "testcase"), ("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
        assert int(root.get(name)) == len(list(root.iter(tag))) == sum(int(suite.get(name)) for suite in root)
    assert int(root.get("failures")) == sum(
        not each["as_expected"] for each in results.verdicts if each["outcome"] != "error"
    )


def test_an_incomplete_run_is_in_error():
    root = parsed(synthetic_results(planned=40, complete=False, reason="interrupted by the user"))
    (case,) = [case for case in root.iter("testcase") if case.get("name") == "every planned verdict ran"]
    assert kinds(case) == ["error"]
    assert case[0].get("message") == "13 of 40 planned verdicts ran: incomplete, interrupted by the user"
    assert not [case for case in parsed(synthetic_results()).iter("testcase") if case.get("classname") == "hapticeval"]
