"""Hostile drift models: documents that `compensate train` could have written, tampered with."""

from __future__ import annotations

import copy
import functools
import json

import numpy as np

from testbed.compensation.document import sealed
from testbed.compensation.model_only import train
from testbed.compensation.record import GyroRecord

HOSTILE = (
    *(None, True, False, "", "x", "1.0", "nan", [], {}, [1.0], {"a": 1}, [[]], 0, -1, 1, 1.5, 10**400, -(10**30)),
    *(1e308, -1e308, 1e-308, 5e-324, float("nan"), float("inf"), -float("inf"), 1e16, -1e16, 2.0**60, "x" * 10_000),
)
# Of a drift that a gyro may have [rad/s]; what a model is tried on.
MOST_DRIFT = 0.1
TRIED = GyroRecord(np.full(50, 1e-5), np.linspace(280.0, 310.0, 50), 1.0)


@functools.cache
def documents():
    """Return the documents of two models, trained on two short cycles, by their method."""
    rng = np.random.default_rng(3)
    heat = 293.0 + 20.0 * np.sin(np.arange(30_000) / 3000.0)
    cycles = [GyroRecord(1e-6 * (heat - 293.0) + 1e-7 * rng.standard_normal(heat.size), heat, 1.0) for _ in range(2)]
    return {
        method: sealed({**train(cycles, method=method).to_dict(), "trained_on": {"a" * 64: "up"}})
        for method in ("gradient", "lssvm")
    }


def places(node, path=()):
    """Yield the path of everything in a document; of a long list, of its first two."""
    entries = node.items() if isinstance(node, dict) else enumerate(node[:2])
    for key, value in entries:
        yield (*path, key)
        if isinstance(value, dict | list):
            yield from places(value, (*path, key))


def tampered(document, rng):
    """Return the document with one thing replaced, removed, repeated or added."""
    changed = copy.deepcopy(document)
    *path, last = rng.choice(list(places(changed)))
    node = changed
    for step in path:
        node = node[step]
    action = rng.random()
    if action < 0.75:
        node[last] = rng.choice(HOSTILE)
    elif action < 0.85:
        del node[last]
    elif isinstance(node, list):
        node.append(node[last])
    else:
        node["extra"] = node[last]
    return changed


def drift_model(rng):
    """Return the text of a model that was changed in its numbers, sealed anew or not, or in its characters."""
    changed = documents()[rng.choice(("gradient", "lssvm"))]
    for _ in range(rng.choice((1, 1, 2, 4))):
        changed = tampered(changed, rng)
        if not isinstance(changed, dict) or not changed:
            break
    text = json.dumps(sealed(changed) if isinstance(changed, dict) and rng.random() < 0.8 else changed)
    if rng.random() < 0.8:
        return text
    i = rng.randrange(len(text))
    return text[:i] + rng.choice(("", "[" * 3000, "{", "}", '"', "9" * 5000, "NaN", "1e999", "\0", ",")) + text[i + 1 :]
