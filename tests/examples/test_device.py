"""The program that shows a device: the table, the picture, and what is no device or no place."""

import re

import numpy as np
import pytest

from hapticeval.devices.parallelogram import Parallelogram2
from hapticeval.errors import HapticevalError
from hapticeval.examples.studies.device import main, write_device


def output(capsys, *arguments):
    assert main(arguments) == 0
    return re.sub(r"\s+", " ", capsys.readouterr().out)


def test_the_robot_in_the_plane(tmp_path, capsys):
    text = output(capsys, "parallelogram-2dof", "-o", str(tmp_path / "new"))
    for expected in (
        "printed (2.35) and lagrangian are the same",
        "inertia 0.1524 kg along (0, 1) 2.267 kg along (1, 0)",
        "anisotropy 14.87",
        "stiffest (2.40) 561.3 N/m along (0, 1) 2333 N/m along (1, 0)",
        "resolution (7.191, 8.293) µm",
        "with motors of 0.368 N m",
        "nearest limit x1 - x2 = 0 rad (0 degrees) is 1 rad (57.3 degrees) within its limit",
        "sampling rate 1000 Hz",
    ):
        assert expected in text
    paths = [tmp_path / "new" / f"device-parallelogram-2dof.{kind}" for kind in ("svg", "png")]
    assert all(f"wrote {path}" in text for path in paths)
    svg = paths[0].read_text(encoding="utf-8")
    assert "functional workspace" in svg
    assert "x₁ − x₂ at its limit" in svg  # noqa: RUF001
    assert paths[1].read_bytes().startswith(b"\x89PNG")


def test_the_robot_in_space_says_its_dynamics(tmp_path, capsys):
    name = "parallelogram-3dof:dynamics=printed,base_inertia=cos"
    text = output(capsys, name, "--at", "0.05,0.1,-0.05", "--torque", "2", "-o", str(tmp_path))
    assert "printed, (2.26): they create energy; base inertia d₀ with cos² x₃" in text
    assert "hand (50, 100, -50) mm" in text
    assert "with motors of 2 N m" in text
    svg = (tmp_path / "device-parallelogram-3dof.svg").read_text(encoding="utf-8")
    assert "base's axis: singular" in svg
    assert "printed dynamics, d₀ with cos² x₃" in svg


def test_the_same_device_gives_the_same_picture(tmp_path):
    device = Parallelogram2()
    one, two = (write_device(tmp_path, device, np.zeros(2), stem=stem) for stem in ("one", "two"))
    assert [path.read_bytes() for path in one] == [path.read_bytes() for path in two]


def test_a_place_that_cannot_be_written_is_an_error(refused, tmp_path):
    (tmp_path / "file").write_text("")
    with refused(HapticevalError):
        write_device(tmp_path / "file", Parallelogram2(), np.zeros(2), stem="one")


def test_a_point_mass_has_no_picture(tmp_path, capsys):
    text = output(capsys, "point-mass:mass=0.2,dimension=3", "-o", str(tmp_path))
    assert "workspace all of space" in text
    assert "0.2 kg along (1, 0, 0)" in text
    assert "wrote" not in text
    assert "0 N/m" not in text
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("parallelogram",), "did you mean parallelogram-"),
        (("point-mass",), "lacks the parameter 'mass'\n  what to do: write for instance point-mass:mass=0.1\n"),
        (("point-mass:dimension=3",), "write for instance point-mass:dimension=3,mass=0.1\n"),
        (("parallelogram-2dof", "--at", "0.4,0"), "the links reach from"),
        (("parallelogram-2dof", "--at", "0,0,0"), "it is not 2 finite numbers"),
        (("parallelogram-2dof", "--at", "0;0"), "it is not 2 finite numbers"),
        (("parallelogram-2dof", "--at", "nan,0"), "it is not 2 finite numbers"),
        (("parallelogram-3dof", "--at", "-0.346,0,0"), "a singularity"),
        (("parallelogram-2dof", "--torque", "-1"), "torque_limit = -1"),
    ],
)
def test_what_cannot_be_computed_ends_with_2(arguments, message, tmp_path, capsys):
    assert main([*arguments, "-o", str(tmp_path)]) == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
