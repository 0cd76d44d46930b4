"""Hostile inputs, each a function of its seed: texts, mutated documents, hostile YAML, drift models, options."""

from __future__ import annotations

import copy
import functools
import json
import random
import re
from pathlib import Path

from ruamel.yaml import YAML

from tests.fuzz.models import drift_model
from tests.fuzz.texts import BASES, BELIEF, FUSION, MAP, REQUIREMENT, RESPONSE, STUDY

SCENARIOS = sorted((Path(__file__).parents[2] / "scenarios").rglob("*.yaml"))
# A command with what it reads, which lies beside the case and is refused where all else is well, so that nothing long
# is played; and its options that take words.
COMMANDS = {
    "replay": (
        ["log.csv", "--map", "map.yaml"],
        ("--filter", "--belief", "--start", "--settle", "--lines", "--outputs", "--fusion"),
    ),
    "export": (["missing"], ("--format",)),
    "identify": (
        ["response.csv", "--input=2", "--output=3"],
        ("--output", "--input", "--separator", "--decimal", "--skip", "--only"),
    ),
    "sweep": (["study.yaml", "--only=x"], ("--only", "--workers", "--scheduler")),
    "regress": (["--filter=x"], ("--only", "--filter", "--workers", "--update")),
    "design": (["missing.yaml"], ("--seeds",)),
}
WORDS = (
    *("kalman", "kalman,imm", ",", "kalman,,", "mhd_ars", "rest", "csv", "eq39", "2", "3", "0:1", "-1:0", "1:x", ":"),
    *("metrics", "report,metrics", "os:system", "10 Hz", "0.5, 10 Hz", "0", "map.yaml", "missing.yaml", "", "tab"),
)

NUMBERS = (
    *("0", "-0", "-1", "1", "1e-300", "1e300", "5e-324", "1.7e308", "1e-12", "1e9", "1e12", "1e-6", "1e6", "nan"),
    *("inf", "-inf", "1e999", "0.1", "3", "1e-3", "1e3", "9" * 70, "0." + "0" * 60 + "1", "1_000", "0x10", "١"),
)
UNITS = (
    *("s", "Hz", "deg/s", "rad", "K", "", "kg", "s**9**9**9", "(((s)))", "sqrt(sqrt(s))", "s^-9", "furlong", "1/s"),
    *("s" * 200, "Mm^9 Mm^9 Mm^9 Mm^9 Mm^9 Mm^9 Mm^9", "%", "ppm", "deg/sqrt(h)", "°/√h", "\u202e s", "s\0"),
)
SCALARS = (
    *(None, True, False, 0, -1, 1, 2**31, 2**63, 2**64, 10**60, 0.5, -0.0, 1e308, 1e-308, float("nan"), float("inf")),
    *("", " ", "off", "on", "auto", "exact", "x" * 5000, "a:b", "os:system", "../../etc/passwd", "/dev/zero", "\u0000"),
    *("kalman", "sx300", "mhd_ars", "2024-01-01", "!!set", "<<", "*a", "1:2:3", "ä", "\U0001f600", "rest", "fixed"),
)
KEYS = (
    *("name", "seed", "duration", "motion", "sensors", "fusion", "turntable", "expect", "type", "preset", "belief"),
    *(
        "mode",
        "file",
        "plugins",
        "column",
        "unit",
        "time",
        "epoch",
        "rate",
        "__class__",
        "model_fields",
        "x",
        "",
        "1",
        "x" * 300,
        "a.b",
        "ä",
    ),
)
TOKENS = (
    *("{", "}", "[", "]", ":", ": ", "- ", "&a ", "*a", "<<: *a", "!!python/object:os.system ", "!x ", "|", ">"),
    *("#", "%YAML 1.1\n---\n", "---\n", "...\n", "\t", "\n", "\r", "\0", "\ufeff", "\u2028", "? ", "@", "`", "1e999"),
    *("[" * 60, "{a: " * 60, "- " * 60, "9" * 90, "&a [*a]", " " * 300, "\n" * 100, "null", "1_0", "0o17", "'", '"'),
    *("~", "2024-99-99"),
)


@functools.cache
def loaded(text):
    return YAML(typ="safe", pure=True).load(text)


def dumped(tree):
    """Return a tree as YAML in flow style, which JSON is."""
    return json.dumps(tree, ensure_ascii=False, default=str)


def base(rng):
    """Return the text of a valid scenario, mostly a quick one."""
    return rng.choice(BASES) if rng.random() < 0.97 else rng.choice(SCENARIOS).read_text(encoding="utf-8")


def scenario_text(rng):
    """Return a scenario's text after some edits of its characters."""
    text = base(rng)
    for _ in range(rng.randint(1, 6)):
        i, j = sorted(rng.randrange(len(text) + 1) for _ in range(2))
        j = min(j, i + rng.choice((0, 1, 3, 30)))
        text = text[:i] + rng.choice((*TOKENS, "", text[i:j] * 3, *NUMBERS, *UNITS)) + text[j:]
    return text


def places(node, path=()):
    """Yield the path of everything in a tree."""
    for key, value in node.items() if isinstance(node, dict) else enumerate(node):
        yield (*path, key)
        if isinstance(value, dict | list):
            yield from places(value, (*path, key))


def hostile(rng, depth=0):
    if depth < 3 and rng.random() < 0.25:
        inner = [hostile(rng, depth + 1) for _ in range(rng.randint(0, 4))]
        return inner if rng.random() < 0.5 else {rng.choice(KEYS): value for value in inner}
    return rng.choice(SCALARS) if rng.random() < 0.7 else f"{rng.choice(NUMBERS)} {rng.choice(UNITS)}"


def changed(rng, value):
    """Return a value like `value`, mostly with its unit, at an extreme; or anything."""
    number = re.match(r"\s*[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?", value) if isinstance(value, str) else None
    if number and rng.random() < 0.5:
        return f"{float(number[0]) * rng.choice((0.5, 2, 0.1, 10, 0.01, 100, 1e-3, 1e3)):g}{value[number.end() :]}"
    if number and rng.random() < 0.7:
        return f"{rng.choice(NUMBERS)}{value[number.end() :]}"
    if number and rng.random() < 0.5:
        return f"{number[0]} {rng.choice(UNITS)}"
    if isinstance(value, int | float) and rng.random() < 0.6:
        return (
            value * rng.choice((0, -1, 1e-9, 1e9, 1e300, 2, 0.5))
            if rng.random() < 0.7
            else int(rng.choice((0, 1, -1, 2, 99, 10**9)))
        )
    if isinstance(value, list) and value and rng.random() < 0.6:
        return value * rng.choice((2, 50)) if rng.random() < 0.5 else [changed(rng, item) for item in value]
    return hostile(rng)


def mutated(rng, text):
    """Return the text of a scenario whose tree was changed in one to four places."""
    tree = copy.deepcopy(loaded(text))
    for _ in range(rng.choice((1, 1, 2, 4))):
        *path, last = rng.choice(list(places(tree)))
        node = tree
        for step in path:
            node = node[step]
        action = rng.random()
        if action < 0.7:
            node[last] = changed(rng, node[last])
        elif action < 0.85:
            del node[last]
        elif isinstance(node, dict):
            node[rng.choice(KEYS)] = hostile(rng)
        else:
            node.append(hostile(rng))
        if not tree:
            break
    return dumped(tree)


def scenario_tree(rng):
    return mutated(rng, base(rng))


def nested(rng, depth=0):
    """Return a piece of YAML in flow style, with anchors, aliases, tags and merges."""
    roll = rng.random()
    if depth > rng.choice((3, 30)) or roll < 0.3:
        return rng.choice((*TOKENS, *map(str, SCALARS)))
    anchor = rng.choice(("", "", f"&a{rng.randint(0, 3)} ", "!!set ", "!t "))
    inner = [nested(rng, depth + 1) for _ in range(rng.randint(0, 4))]
    if roll < 0.6:
        return f"{anchor}[{', '.join(inner)}]"
    if roll < 0.9:
        return f"{anchor}{{{', '.join(f'{rng.choice(KEYS)}: {value}' for value in inner)}}}"
    return f"*a{rng.randint(0, 3)}"


def hostile_yaml(rng):
    """Return YAML that is no scenario: bombs, depth, tags, directives, raw characters."""
    kind = rng.randrange(4)
    if kind == 0:
        levels, width = rng.randint(1, 30), rng.randint(1, 12)
        lines = ["a0: &a0 {x: 1 s}"]
        for i in range(1, levels):
            alias = f"*a{i - 1}"
            inner = (
                f"{{<<: [{', '.join([alias] * width)}]}}" if rng.random() < 0.3 else f"[{', '.join([alias] * width)}]"
            )
            lines.append(f"{rng.choice(('motion', 'sensors', f'a{i}'))}: &a{i} {inner}")
        return "\n".join(lines)
    if kind == 1:
        return rng.choice(TOKENS) * rng.choice((1, 10, 1000, 20_000)) + rng.choice(TOKENS) * rng.choice((0, 1, 1000))
    if kind == 2:
        return "".join(
            chr(rng.choice((rng.randrange(128), rng.randrange(0xD7FF)))) for _ in range(rng.choice((3, 30, 3000)))
        )
    return f"name: a\nduration: 1 s\n{rng.choice(KEYS)}: {nested(rng)}\n"


def log_map(rng):
    """Return the text of a map that was changed in its tree or in its characters."""
    if rng.random() < 0.7:
        return mutated(rng, MAP)
    i = rng.randrange(len(MAP))
    return MAP[:i] + rng.choice((*TOKENS, *NUMBERS, *UNITS)) + MAP[i + rng.choice((0, 1, 10)) :]


def tree_of(text):
    """Return the maker of texts whose tree is that of a document, changed."""
    return lambda rng: mutated(rng, text)


def response_text(rng):
    """Return a recording some of whose fields were changed, or its characters."""
    rows = RESPONSE.splitlines()
    for _ in range(rng.choice((1, 3, 100))):
        row = rng.randrange(len(rows))
        fields = rows[row].split(",")
        fields[rng.randrange(len(fields))] = rng.choice((*NUMBERS, "", "nan", "x", "0", "1,2"))
        rows[row] = ",".join(fields)
    if rng.random() < 0.3:
        del rows[rng.randrange(1, len(rows)) :]
    if rng.random() < 0.3:
        rows[rng.randrange(len(rows))] = rng.choice(TOKENS)
    return "\n".join(rows)


def options(rng):
    """Return the words of a command line, as JSON: one of `COMMANDS` with one to three options of any value."""
    name = rng.choice(list(COMMANDS))
    given, known = COMMANDS[name]
    extra = [f"{rng.choice(known)}={word(rng)}" for _ in range(rng.choice((1, 1, 2, 3)))]
    return json.dumps([name, *given, *extra])


def word(rng):
    roll = rng.random()
    if roll < 0.5:
        return rng.choice(WORDS)
    number = rng.choice((*NUMBERS, "9" * 5000))
    return number if roll < 0.7 else f"{number}:{number}" if roll < 0.8 else str(rng.choice(SCALARS))


KINDS = {
    "text": scenario_text,
    "tree": scenario_tree,
    "yaml": hostile_yaml,
    "model": drift_model,
    "map": log_map,
    "belief": tree_of(BELIEF),
    "fusion": tree_of(FUSION),
    "study": tree_of(STUDY),
    "requirement": tree_of(REQUIREMENT),
    "response": response_text,
    "options": options,
}


def case(kind, seed):
    """Return the text of a case."""
    return KINDS[kind](random.Random(f"{kind} {seed}"))
