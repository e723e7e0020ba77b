"""The command for an extra: it names a folder or libraries, and never this package in an index."""

import json
import shlex
from pathlib import Path

import pytest

from hapticeval import extras

REQUIRES = ["numpy>=1.26", "rosbags>=0.10; extra == 'ros'", 'distributed>=2024.8 ; extra == "cluster"']


class Installed:
    def __init__(self, url, *, editable):
        self.requires = REQUIRES
        self.origin = {"url": url, "dir_info": {"editable": True} if editable else {}}

    def read_text(self, name):
        assert name == "direct_url.json"
        return json.dumps(self.origin) if self.origin["url"] else None


@pytest.mark.parametrize(
    ("installed", "words"),
    [
        (Installed("file:///home/me/my%20work/hapticeval", editable=True),
         ["pip", "install", "--editable", "/home/me/my work/hapticeval[ros]"]),
        (Installed("file:///tmp/hapticeval-0.1.0.whl", editable=False), ["pip", "install", "rosbags>=0.10"]),
        (Installed("", editable=False), ["pip", "install", "rosbags>=0.10"]),
    ],
)  # fmt: skip
def test_of_a_checkout_the_folder_and_of_a_wheel_the_libraries(monkeypatch, installed, words):
    monkeypatch.setattr(extras, "distributions", lambda name: [installed])
    assert shlex.split(extras.install_command("ros")) == words


def test_without_an_installation_the_folder_is_described(monkeypatch):
    monkeypatch.setattr(extras, "distributions", lambda name: [])
    assert extras.install_command("ros").startswith("pip install '.[ros]', in the folder")


def test_what_a_build_leaves_in_the_current_folder_hides_no_installation(monkeypatch, tmp_path):
    here = extras.install_command("ros")
    left = tmp_path / "hapticeval.egg-info"
    left.mkdir()
    (left / "PKG-INFO").write_text("Metadata-Version: 2.1\nName: hapticeval\nVersion: 0.1.0\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    assert extras.install_command("ros") == here


def test_this_checkout_is_named():
    folder = shlex.split(extras.install_command("cluster"))[-1].removesuffix("[cluster]")
    assert (Path(folder) / "pyproject.toml").exists()
