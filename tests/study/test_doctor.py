"""The walk through the contract: it finds what is missing, and outlives who crashes or hangs."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import pytest

import hapticeval
from hapticeval.cli import main
from hapticeval.commands.authors import ANSWER_SECONDS
from hapticeval.study import doctor
from hapticeval.study.doctor import State, examine

MODULE = """
import os, time
from dataclasses import replace
import numpy as np
from hapticeval.discovery import resolve
from hapticeval import RefusalError

class Good:
    supports = {"plane", "space"}
    def __init__(self, scene):
        self.boundary, self.stiffness = scene.model.boundary, scene.stiffness
    def reset(self, hip):
        pass
    def step(self, hip, velocity, dt):
        found = self.boundary.closest_point([hip])
        ihip = found.foot[0] if found.distance[0] < 0.0 else hip
        return ihip, self.stiffness * (ihip - hip)

class Pulls(Good):
    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        return ihip, -force

class OneTriangle(Good):
    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        turns = ihip.size == 3 and force[0] > 0.0 and ihip[1] > ihip[2]
        return ihip, -force if turns else force

class OneSide(Good):
    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        return ihip, -force if force[1] < -0.5 * np.linalg.norm(force) else force

class Hums(Good):
    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        return ihip, force + 0.01

class Shifts(Good):
    def step(self, hip, velocity, dt):
        hip -= 0.05
        ihip, force = super().step(hip + 0.05, velocity, dt)
        return (ihip, force) if force.any() else (hip, force)

class Scratches(Good):
    def step(self, hip, velocity, dt):
        answer = super().step(hip.copy(), velocity, dt)
        hip *= 1e200
        return answer

class Sticks(Good):
    held = None
    def reset(self, hip):
        self.held = None
    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        if force.any():
            self.held = ihip
        return (ihip, force) if self.held is None else (self.held, self.stiffness * (self.held - hip))

class Wears(Good):
    worn = 0.0
    def step(self, hip, velocity, dt):
        self.worn += 1e-6
        ihip, force = super().step(hip, velocity, dt)
        return ihip, force * (1.0 + self.worn)

class Late(Good):
    ticks = 12
    def reset(self, hip):
        super().reset(hip)
        self.past = []
    def step(self, hip, velocity, dt):
        self.past.append(super().step(hip, velocity, dt))
        return self.past[max(0, len(self.past) - 1 - self.ticks)]

class LittleLate(Late):
    ticks = 2

class Drags(Good):
    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        if force.any():
            out = force / np.linalg.norm(force)
            force = force - 2.0 * (velocity - (velocity @ out) * out)
        return ihip, force

class SlowInContact(Good):
    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        if force.any():
            time.sleep(0.0015)
        return ihip, force

class Blind(Good):
    def step(self, hip, velocity, dt):
        return super().step(np.nan_to_num(hip), velocity, dt)

class Rests(Good):
    def step(self, hip, velocity, dt):
        return super().step(hip, velocity, dt) if np.isfinite(hip).all() else (hip, 0.0 * np.nan_to_num(hip))

class Passes(Good):
    def step(self, hip, velocity, dt):
        return super().step(hip, velocity, dt) if np.isfinite(hip).all() else (hip, hip)

class Locks(Good):
    locked = False
    def reset(self, hip):
        self.locked = False
    def step(self, hip, velocity, dt):
        self.locked = self.locked or not np.isfinite(hip).all()
        if self.locked:
            raise ValueError("no hand")
        return super().step(hip, velocity, dt)

class Other(Good):
    def __init__(self, scene):
        super().__init__(scene)
        self.law = resolve("minimum-distance")(replace(scene, stiffness=2.0 * scene.stiffness)).law

class Divides(Good):
    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        with np.errstate(all="ignore"):
            return ihip, np.linalg.norm(force) * (ihip - hip) / np.linalg.norm(ihip - hip)

class WearsOut(Good):
    ticks = 0
    def step(self, hip, velocity, dt):
        self.ticks += 1
        ihip, force = super().step(hip, velocity, dt)
        return ihip, force if self.ticks < 650 else force * np.nan

class Flat(Good):
    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        return ihip, force[:2]

class Beside(Good):
    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        return (ihip - 0.05 * force / np.linalg.norm(force) if force.any() else ihip), force

class Faceted(Good):
    supports = None
    def __init__(self, scene):
        super().__init__(scene)
        self.facets = scene.model.boundary.triangles

class Trips(Good):
    def step(self, hip, velocity, dt):
        if self.boundary.signed_distance(np.array([hip])) < 0.0:
            raise IndexError("no face is here")
        return super().step(hip, velocity, dt)

class Property(Good):
    @property
    def contact(self):
        raise KeyError("no such flag")

class Ball(Good):
    standoff = 1.1e-3
    def step(self, hip, velocity, dt):
        found = self.boundary.closest_point([hip])
        ball = found.foot[0] + self.standoff * found.normal[0]
        ihip = ball if found.distance[0] < self.standoff else hip
        return ihip, self.stiffness * (ihip - hip)

class Balloon(Ball):
    standoff = 1e-2

class Dies(Good):
    def step(self, hip, velocity, dt):
        if self.boundary.closest_point([hip]).distance[0] < 0.0:
            os._exit(7)
        return super().step(hip, velocity, dt)

class Waits(Good):
    def step(self, hip, velocity, dt):
        time.sleep(3600)

class Millimetres(Good):
    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        return 1e3 * ihip, force

class Soft(Good):
    def step(self, hip, velocity, dt):
        ihip, force = super().step(hip, velocity, dt)
        return ihip, 1e-3 * force

class Takes(Good):
    def step(self, hip):
        pass

class Raises(Good):
    def __init__(self, scene):
        raise OSError("no licence")

class Nothing(Good):
    def __init__(self, scene):
        raise RefusalError("nothing suits it")
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    (tmp_path / "patients.py").write_text(MODULE)
    yield tmp_path
    sys.modules.pop("patients", None)


@cache
def examined(name: str) -> tuple[doctor.ContractFinding, ...]:
    """What the doctor finds of a renderer, which is examined once, in a process of its own."""
    return tuple(examine(name, patience=ANSWER_SECONDS))


@pytest.mark.parametrize(
    ("name", "ails"),
    [
        ("Good", {}),
        ("Pulls", {"contact": "missing", "reset inside": "missing"}),
        ("OneTriangle", {"contact": "missing"}),
        ("OneSide", {"contact": "missing"}),
        ("Hums", {"free space": "missing", "leaving": "missing"}),
        ("Sticks", {"leaving": "missing"}),
        ("Wears", {"reset": "missing", "non-finite": "missing"}),
        ("Blind", {"non-finite": "missing"}),
        ("Rests", {}),
        ("Scratches", {}),
        ("Passes", {"non-finite": "missing"}),
        ("Locks", {"non-finite": "missing"}),
        ("Other", {"law": "missing"}),
        ("Dies", dict.fromkeys(("contact", "leaving", "reset", "reset inside", "non-finite", "lag", "speed"), "broke")),
        ("Late", {"free space": "missing", "leaving": "missing", "lag": "missing"}),
        ("Property", {"made": "broke"}),
        ("Ball", {}),
        ("Balloon", {"contact": "missing"}),
        ("Raises", {"made": "broke"}),
        ("Nothing", {"dimension": "missing"}),
    ],
)
def test_what_ails_a_renderer_is_found(here: Path, name: str, ails: dict[str, str]) -> None:
    found = examined(f"patients:{name}")
    assert {each.what: str(each.state) for each in found if each.state in (State.MISSING, State.BROKE)} == ails
    assert doctor.exit_code(found) == (3 if "broke" in ails.values() else int(bool(ails)))


@pytest.mark.parametrize(
    ("name", "passes"),
    [("Good", True), ("Rests", True), ("Blind", False), ("Passes", False), ("Locks", False)],
)
def test_the_check_of_a_missing_position_says_the_same(here: Path, name: str, passes: bool) -> None:
    """As the doctor above: one rule."""
    results = hapticeval.run(f"patients:{name}", suites=["field"], select="round-a-circle/drop-out", workers=0)
    assert [verdict.outcome for verdict in results.verdicts] == ["pass" if passes else "fail"]


def test_one_that_hangs_is_given_up_where_it_hangs(here: Path) -> None:
    waits: list[tuple[str, float, float]] = []
    found = list(examine("patients:Waits", patience=0.5, waiting=lambda *wait: waits.append(wait)))
    assert [(each.what, str(each.state)) for each in found] == [("made", "ok"), ("free space", "broke")]
    line = MODULE.splitlines().index("        time.sleep(3600)") + 1
    assert f"in patients.py, line {line}, in step: time.sleep(3600)" in found[-1].text
    assert "waiting for 'free space' in the plane" in {what for what, *_ in waits}


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Property", "raised KeyError: 'no such flag'; in patients.py, line"),
        ("Takes", "it is called as step(hip, velocity, dt)"),
    ],
)
def test_what_broke_is_named(here: Path, name: str, words: str) -> None:
    first = next(each for each in examined(f"patients:{name}") if each.state is State.BROKE)
    assert words in first.text


@pytest.mark.parametrize(
    ("name", "what", "state", "words"),
    [
        ("Millimetres", "free space", State.MISSING, "points are in m, not in mm"),
        ("Millimetres", "contact", State.MISSING, "points are in m, not in mm"),
        ("Shifts", "free space", State.MISSING, "step() changes the hip that it is given: change a copy"),
        ("Soft", "contact", State.NOTE, "a factor of 1000"),
        ("Late", "lag", State.MISSING, "the force comes 12 ms late (12 ticks)"),
        ("LittleLate", "lag", State.NOTE, "2 ms late (2 ticks); 3 ticks are granted"),
        ("Drags", "lag", State.NOTE, "it drags along the surface, by 2 N s/m"),
        ("SlowInContact", "speed", State.MISSING, "ms in contact; 99 % in "),
        ("Balloon", "contact", State.MISSING, "declares a standoff of 10 mm, of which"),
        ("Pulls", "reset inside", State.MISSING, "turn its sign"),
    ],
)
def test_a_unit_a_sign_or_a_changed_argument_is_named(
    here: Path, name: str, what: str, state: State, words: str
) -> None:
    found = [each for each in examined(f"patients:{name}") if each.what == what]
    assert len(found) == 2, "in the plane and in space"
    assert all(each.state is state and words in each.text for each in found)


def test_one_cause_is_reported_once(here: Path) -> None:
    texts = [each.text for each in examined("patients:Dies") if each.state is State.BROKE]
    assert texts == ["it ends the process that it runs in: exit code 7"] + ["as at 'contact' in the plane"] * 13


@pytest.mark.parametrize("name", ["constraint", "minimum-distance"])
def test_our_own_keep_the_contract(name: str) -> None:
    assert [each for each in examined(name) if each.state not in (State.OK, State.NOTE)] == []


def test_the_command_shows_it(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "-r", "patients:Sticks"]) == 1
    out = capsys.readouterr().out
    assert "missing leaving" in out
    assert "still holds the hand" in out
    assert main(["doctor", "-r", "patients:None"]) == 2


def test_what_broke_can_be_asked_again_by_the_program_that_the_doctor_prints(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, place in (("Divides", "free space"), ("Trips", "contact")):
        assert main(["doctor", "-r", f"patients:{name}"]) == 3
        advice = capsys.readouterr().out.partition("\nnext: ")[2]
        assert advice.startswith(f"mend what broke at '{place}' first")
        assert ("divides by zero" in advice) is (name == "Divides")
        program = "".join(f"{line[2:]}\n" for line in advice.splitlines() if line.startswith("  "))
        if name == "Divides":
            exec(program, {})
            assert "nan" in capsys.readouterr().out
        else:
            with pytest.raises(IndexError, match="no face is here"):
                exec(program, {})
    assert main(["doctor", "-r", "patients:Good"]) == 0
    assert "next:" not in capsys.readouterr().out
    assert doctor.next_steps("p", examined("patients:Raises")) == [
        "next: mend what broke at 'made' first; what broke as it did goes with it"
    ]


def test_a_renderer_of_solids_alone_is_told_how_to_say_so(here: Path) -> None:
    steps = doctor.next_steps("p", examined("patients:Faceted"))
    assert steps[1:] == ["or, if it is for models in space alone, have it say so: supports = {'space'}"]


def test_a_kind_that_is_refused_is_not_proposed_as_all_that_it_is_for() -> None:
    refuses_the_plane = [
        doctor.ContractFinding("made", "plane", State.NOTE, "it refuses the scene"),
        doctor.ContractFinding("made", "space", State.OK, "made"),
        doctor.ContractFinding("free space", "space", State.BROKE, "it raised"),
    ]
    assert not [line for line in doctor.next_steps("p", refuses_the_plane) if "supports" in line]


def test_a_force_of_the_plane_in_space_is_named_wherever_it_is_asked(here: Path) -> None:
    findings = examined("patients:Flat")
    broke = [finding for finding in findings if finding.state is State.BROKE]
    assert {finding.kind for finding in broke} == {"space"}
    assert "a force of shape (2,)" in broke[0].text
    # As the first, and not as an error of the doctor's own.
    assert broke[-1].what == "speed"
    assert "doctor.py" not in broke[-1].text
    assert doctor.next_steps("p", findings)[1] == (
        "or, if it is for models in the plane alone, have it say so: supports = {'plane'}"
    )


def test_numbers_that_become_none_while_it_is_timed_are_seen(here: Path) -> None:
    broke = [finding for finding in examined("patients:WearsOut") if finding.state is State.BROKE]
    assert {"lag", "speed"} <= {finding.what for finding in broke}
    assert "not finite" in broke[0].text


def test_no_standoff_is_advised_that_would_not_be_believed(here: Path) -> None:
    (text, *_) = [finding.text for finding in examined("patients:Beside") if finding.what == "contact"]
    assert "put it there; of a standoff 4 mm count here at the most" in text
