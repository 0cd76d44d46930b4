"""What comes in from outside is bounded before it is built: each kind of hostile file, by its generator."""

from __future__ import annotations

import os
import socket
import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from testbed.errors import MOST_QUOTED, ScenarioError, UnknownNameError, quoted, shortened, shortened_path
from testbed.inputs.files import read_bytes
from testbed.inputs.tree import MOST_BYTES, MOST_CHARACTERS, MOST_DEPTH, MOST_DIGITS, MOST_NODES, read_yaml

# What `check` may take for anything [s]; a refusal here takes a tenth of it.
_PATIENCE = 5.0


def refusal(path):
    """Return the one problem with which a file is refused, within the time that is promised."""
    begin = time.monotonic()
    with pytest.raises(ScenarioError) as caught:
        read_yaml(path, "a scenario")
    assert time.monotonic() - begin < _PATIENCE
    (problem,) = caught.value.problems
    assert len(problem.message) < 400
    return problem


def written(tmp_path, text):
    path = tmp_path / "file.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_date_is_a_text_as_it_was_written(tmp_path):
    text = "name: 2024-05-01\nepoch: [2024-05-01T12:00:00Z, 2024-99-99]\n2024-05-02 1:00:00: '2024-05-03'\n"
    tree = read_yaml(written(tmp_path, text), "a scenario")
    assert tree.data == {
        "name": "2024-05-01",
        "epoch": ["2024-05-01T12:00:00Z", "2024-99-99"],
        "2024-05-02 1:00:00": "2024-05-03",
    }


@pytest.mark.parametrize("path", ["/proc/kmsg", "/proc/uptime"])
def test_what_the_kernel_makes_up_is_not_waited_for(path):
    if not os.path.exists(path):  # noqa: PTH110
        pytest.skip("only Linux has it")
    assert read_bytes(path, 100, "a scenario") == b""


def test_read_yaml_gives_plain_values_and_their_lines(tmp_path):
    tree = read_yaml(written(tmp_path, "a: 1\nb:\n  - x\n  - {c: 2 s}\nd: &q [1, 2]\ne: *q\n"), "a scenario")
    assert tree.data == {"a": 1, "b": ["x", {"c": "2 s"}], "d": [1, 2], "e": [1, 2]}
    assert type(tree.data) is dict
    assert [tree.line(key) for key in (("a",), ("b", 0), ("b", 1, "c"), ("b", 9), ("e",), ("z",))] == [
        1,
        3,
        4,
        2,
        6,
        None,
    ]


UNSEEN = [*map(chr, (0, 7, 8, 0x1B, 0x7F, 0x9B, 0x202E, 0x2066)), "\\ud800"]


@pytest.mark.parametrize("unseen", UNSEEN, ids=[f"{ord(c[0]):x}" for c in UNSEEN])
@pytest.mark.parametrize("text", ["a: 1\nb: TEXT", "a: 1\nTEXT: 2", "a: 1\nb: [x, {c: TEXT}]"])
def test_what_would_act_on_a_terminal_is_refused_with_its_line(tmp_path, unseen, text):
    """A scenario from a stranger is printed; half a character could not even be written."""
    path = tmp_path / "it.yaml"
    escaped = unseen if len(unseen) > 1 else f"\\u{ord(unseen):04x}"
    path.write_text(text.replace("TEXT", f'"x{escaped}[31m"'))
    found = refusal(path)
    assert found.line == 2
    assert "U+" in found.message
    assert found.message.isprintable()


def test_lines_tabs_and_all_scripts_are_text(tmp_path):
    path = tmp_path / "it.yaml"
    path.write_text('a: |\n  two\n  lines\nb: "tab\\t"\nc: 角速度 größer عربى é\U0001f600\n', encoding="utf-8")
    assert read_yaml(path, "it").data["b"] == "tab\t"


def pipe(path):
    os.mkfifo(path)
    return path


def listening(path):
    socket.socket(socket.AF_UNIX).bind(str(path))
    return path


@pytest.mark.filterwarnings("ignore:unclosed:ResourceWarning")
@pytest.mark.parametrize(
    "make",
    [pipe, listening, lambda _: "/dev/zero", lambda path: path.parent, lambda path: path],
    ids=["pipe", "socket", "device", "folder", "nothing"],
)
def test_what_is_no_regular_file_is_refused_at_once(tmp_path, monkeypatch, make):
    monkeypatch.chdir(tmp_path)
    assert refusal(make(tmp_path / "x")).message


def test_a_file_is_read_up_to_its_limit_and_not_beyond(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"x" * 100)
    assert len(read_bytes(path, 100, "it")) == 100
    with pytest.raises(ScenarioError, match="at most 99 bytes"):
        read_bytes(path, 99, "it")


def test_a_path_with_a_null_character_is_refused(tmp_path):
    with pytest.raises(ScenarioError, match="cannot be read"):
        read_bytes(tmp_path / "a\0b", 100, "it")


def bomb(levels, width):
    """Return `levels` lists, each of `width` aliases of the one before: width^levels values."""
    lines = ["a0: &a0 [x]", *(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * width)}]" for i in range(1, levels))]
    return "\n".join(lines)


HOSTILE = {
    **{
        f"{kind} {n} deep": text
        for n in (MOST_DEPTH + 1, 100, 3000)
        for kind, text in (
            ("lists", "a: " + "[" * n + "]" * n),
            ("mappings", "a: " + "{a: " * n + "}" * n),
            ("open", "[" * n),
            ("dashes", "- " * n),
            ("questions", "? " * n),
        )
    },
    "indents": "\n".join(" " * i + "a:" for i in range(700)),
    **{f"bomb {levels} x {width}": bomb(levels, width) for levels, width in ((6, 9), (20, 9), (20, 2), (3, 200))},
    "merge bomb": "\n".join(
        ["a0: &a0 {x: 1}", *(f"a{i}: &a{i} {{<<: [{', '.join([f'*a{i - 1}'] * 9)}]}}" for i in range(1, 12))]
    ),
    **{f"itself {i}": text for i, text in enumerate(("a: &a [*a]", "a: &a {b: *a}", "&a {b: {c: [*a]}}"))},
    **{
        f"tag {tag}": f"a: {tag} x"
        for tag in (
            "!!set",
            "!!python/object:os.system",
            "!own",
            "!!binary",
            "!",
            "!!str",
            "!!omap",
            "!<x>",
            "!<" + "y" * 100_000 + ">",
        )
    },
    "set": "a: !!set {x, y}",
    **{
        f"digits {sign}{n}": f"a: {sign}{'1' * n}"
        for n in (MOST_DIGITS + 1, 400, 4000)
        for sign in ("", "-", "+", ".", "1.", "0x", "1e", "1_")
    },
    "long text": "a: " + "x" * (MOST_CHARACTERS + 1),
    "long key": "x" * (MOST_CHARACTERS + 1) + ": 1",
    "many items": "a: [" + "1, " * MOST_NODES + "]",
    "many keys": "\n".join(f"k{i}: 1" for i in range(MOST_NODES)),
    "large": "# " + "x" * MOST_BYTES,
    "blank": "\n" * MOST_BYTES + "a: 1",
    "two documents": "a: 1\n---\na: 2\n",
    "yaml 3": "%YAML 3.0\n---\na: 1\n",
    "yaml 1.9": "%YAML 1.9\n---\na: 1\n",
    "list key": "[1, 2]: 3",
    "mapping key": "{a: 1}: 3",
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_yaml_is_refused_in_seconds_with_a_short_message(tmp_path, name):
    assert refusal(written(tmp_path, HOSTILE[name])).message


@pytest.mark.parametrize("inside", ["a: " + "[" * MOST_DEPTH, "a: " + "{a: " * MOST_DEPTH, "a: [" + "1, " * MOST_NODES])
def test_a_limit_is_named_with_its_line(tmp_path, inside):
    problem = refusal(written(tmp_path, f"\n\n{inside}"))
    assert problem.line == 3
    assert f"at most {MOST_NODES} values" in problem.message


@pytest.mark.parametrize(
    "text",
    ["a: &x 1\nb: [*x, *x]", "a: &x {p: 1}\nb: {<<: *x, q: 2}", "a: '" + "1" * 500 + "'", "a: 3-axis-" + "x" * 50],
)
def test_what_is_within_the_limits_is_read(tmp_path, text):
    assert read_yaml(written(tmp_path, text), "a scenario").data


@pytest.mark.property
@settings(deadline=None, max_examples=300)
@given(st.text(alphabet=st.sampled_from("abc01 :-?[]{},&*!|>'\"#%@`~<\n\t.+"), max_size=60))
def test_any_text_is_read_or_refused(tmp_path_factory, text):
    path = written(tmp_path_factory.mktemp("any"), text)
    problems = None
    try:
        read_yaml(path, "a scenario")
    except ScenarioError as error:
        problems = error.problems
    assert problems is None or problems[0].message


def deep(levels):
    value = []
    for _ in range(levels):
        value = [value]
    return value


class Mute:
    def __repr__(self):
        raise RuntimeError


@pytest.mark.parametrize(
    "value",
    [
        "x" * 100_000,
        10**5000,
        [1] * 100_000,
        deep(900),
        dict.fromkeys(range(1000), "y" * 1000),
        b"z" * 1000,
        Mute(),
        -(2**2000),
    ],
    ids=["text", "number", "list", "deep", "mapping", "bytes", "mute", "negative"],
)
def test_quoted_shows_at_most_80_characters(value):
    assert 0 < len(quoted(value)) <= MOST_QUOTED
    assert len(shortened(str(value)[:200] if not isinstance(value, int | Mute) else "")) <= MOST_QUOTED


def test_an_unknown_name_is_quoted_short():
    assert "x" * 81 not in str(UnknownNameError("filter", "x" * 100_000, ["kalman"]))


def test_a_long_path_keeps_its_end():
    shown = shortened_path("/home/" + "deep/" * 60 + "log.csv")
    assert shown.startswith("...")
    assert shown.endswith("/deep/log.csv")
    assert len(shown) == MOST_QUOTED
    assert shortened_path("log.csv") == "log.csv"
