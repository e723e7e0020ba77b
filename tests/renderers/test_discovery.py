"""Names of renderers: the grammar, the factories behind them, and what is said when there is none."""

import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hapticeval.discovery import Name, known_renderers, own_renderers, parse, resolve
from hapticeval.errors import InputError, RendererError, UnknownNameError

WORD = st.from_regex(r"[a-z][a-z0-9_:.-]{0,8}", fullmatch=True)
SCHEME = st.from_regex(r"[a-z]{1,4}(\+[a-z]{1,4})?", fullmatch=True)

LOCAL = """
class Plain:
    "A renderer of a third party."
    def __init__(self, scene): pass

class Family:
    regulations = ("pp", "pp+v")
    representations = {"curve": 1, "polygon": 2}
    def __call__(self, scene): pass
    def variant(self, **chosen): return lambda scene: chosen

class Nest:
    make = Plain

family = Family()
number = 3
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty current directory; what is imported from it is forgotten afterwards."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    before = set(sys.modules)
    yield tmp_path
    for name in set(sys.modules) - before:
        if str(getattr(sys.modules[name], "__file__", None)).startswith(str(tmp_path)):
            del sys.modules[name]


@given(WORD, st.none() | SCHEME, st.none() | WORD)
def test_a_name_is_its_parts(base, scheme, representation):
    text = base + ("" if scheme is None else f"+{scheme}") + ("" if representation is None else f"@{representation}")
    assert parse(text) == Name(base, scheme, representation)


@pytest.mark.parametrize("text", ["", "+pp", "constraint+", "constraint@", "constraint+@curve", "@curve"])
def test_an_empty_part_is_refused(refused, text):
    with refused(InputError):
        parse(text)


def test_the_distribution_registers_its_own():
    assert set(own_renderers()) >= {"constraint", "ideal", "minimum-distance"}
    assert set(own_renderers()) <= set(known_renderers())


def test_a_local_file_is_found(here):
    (here / "mine_plain.py").write_text(LOCAL)
    assert resolve("mine_plain:Plain").__doc__ == "A renderer of a third party."
    assert resolve("mine_plain:Nest.make") is resolve("mine_plain:Plain")


def test_a_suffix_chooses_the_variant(here):
    (here / "mine_family.py").write_text(LOCAL)
    scene = None
    assert resolve("mine_family:family+pp+v@polygon")(scene) == {"regulation": "pp+v", "representation": "polygon"}
    assert resolve("mine_family:family@curve")(scene) == {"representation": "curve"}


@pytest.mark.parametrize(
    ("suffix", "close"),
    [("+pq", "pp"), ("@polygn", "polygon")],
)
def test_an_unknown_suffix_names_the_closest(refused, here, suffix, close):
    (here / "mine_suffix.py").write_text(LOCAL)
    with refused(UnknownNameError) as caught:
        resolve(f"mine_suffix:family{suffix}")
    assert close in caught.value.todo


def test_a_suffix_on_a_plain_factory_is_refused(refused, here):
    (here / "mine_no_variant.py").write_text(LOCAL)
    with refused(InputError):
        resolve("mine_no_variant:Plain+pp")


def test_an_unknown_name_names_the_closest(refused):
    with refused(UnknownNameError):
        resolve("constrait")


@pytest.mark.parametrize(
    ("source", "name"),
    [
        (None, "mine_absent:make"),
        ("import absent_dependency", "mine_dep:make"),
        ("\n1 / 0", "mine_raises:make"),
        ("\n\n1 / 0", "mine_line:make"),
        ("def make(:", "mine_syntax:make"),
        ("raise SystemExit(5)", "mine_exits:make"),
        (LOCAL, "mine_lacks:mkae"),
        (LOCAL, "mine_number:number"),
        (LOCAL, "mine_colon:"),
    ],
)
def test_each_failure_says_which_and_why(refused, here, source, name):
    if source is not None:
        (here / f"{name.partition(':')[0]}.py").write_text(source)
    with refused(InputError):
        resolve(name)


@pytest.mark.parametrize("slip", ["mine_slip", "mine_slip.py", "mine_slip.Nearest", "mine_slip.py:Nearest"])
def test_a_slip_in_the_name_of_a_local_file_is_mended(refused, here, slip):
    (here / "mine_slip.py").write_text("def _hidden(scene): ...\nclass Nearest:\n    def step(self): ...\n")
    with refused(InputError):
        resolve(slip)


def test_a_variant_that_raises_is_a_broken_renderer(refused, here):
    (here / "mine_broken.py").write_text("class Made:\n    def variant(**chosen): raise KeyError(3)\n")
    with refused(RendererError):
        resolve("mine_broken:Made+pp")
