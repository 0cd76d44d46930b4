"""Source of lanes whose R adapts, with a covariance of their own."""

from __future__ import annotations

from testbed.fusion.lanes.source import (
    GATE,
    HEAD,
    MEMORY,
    Pattern,
    Workspace,
    added,
    covariance_names,
    entry,
    in_parts,
    less_seen,
    load,
    matrices_of,
    memory_names,
    moved_states,
    over_lanes,
    state_names,
)


def adaptive_source(pattern: Pattern) -> tuple[str, list[str]]:
    """Return the source of run(F, Q, H, W, windows, common, seen, due, started, Z, rate, std, innovation, variance),
    and the rows of its W.

    The Sage-Husa family with R that adapts, a covariance per lane in Joseph form. `windows` (n_sensor, n_window, LANES)
    holds the squared innovations of the sliding windows, `common` (n_sensor,) one SENSOR record per sensor with what
    all lanes have in common, `seen` (n_sensor,) how many readings there were. Z are LANES arrays (n_sensor, n_time),
    `innovation` and its `variance` are (n_lane, n_sensor, n_time), `rate` and `std` (n_lane, n_time), for as many of
    the first lanes as are wanted; ``beyond`` is that of `shared_source`.

    Parameters
    ----------
    pattern : Pattern
        Of F and H.
    """
    n, n_sensor = pattern.n, len(pattern.H)
    rows = Workspace([*state_names(n), *covariance_names(n), *memory_names(n_sensor)])
    text = HEAD % "F, Q, H, W, windows, common, seen, due, Z, rate, std, innovation, variance"
    lines = [*matrices_of(pattern), *(f"    q{i}_{j} = Q[{i}, {j}]" for i in range(n) for j in range(i + 1))]
    lines += ["    n_window = windows.shape[1]", *(line for i in range(n_sensor) for line in _bands(i))]
    moved = [*load(rows, state_names(n)), *moved_states(pattern), *(f"{rows.at(f'x{i}')} = x{i}" for i in range(n))]
    lines += ["    for k in range(due.shape[1]):", *over_lanes(8, [*moved, *_grow(pattern, rows)])]
    for i in range(n_sensor):
        lines += [f"        if due[{i}, k]:", *_observe(pattern, rows, i)]
    for i in range(n_sensor):
        lines += [f"        if due[{i}, k]:", *_use(pattern, rows, i)]
    lines += over_lanes(8, [f"rate[k, s] = {rows.at('x0')}", f"std[k, s] = sqrt({rows.at(entry(0, 0))})"])
    found = {"rate": False, "std": False, "innovation": True, "variance": True}
    run = in_parts(pattern, ("F", "Q", "H"), {"windows": False, "common": False, "seen": False}, found, rows)
    return text + "\n".join(lines) + run, rows.names


def _bands(i: int) -> list[str]:
    """Return R of the bands of a sensor, and the lowest and highest value in each."""
    lines = [f"low{i}, high{i} = common[{i}].thresholds[0], common[{i}].thresholds[1]"]
    for band in range(3):
        lines += [f"level{i}_{band} = common[{i}].levels[{band}]"]
        lines += [f"lowest{i}_{band} = max(common[{i}].floor, level{i}_{band} / common[{i}].clamp)"]
        lines += [f"lowest{i}_{band} = min(level{i}_{band}, lowest{i}_{band})"]
        lines += [f"highest{i}_{band} = level{i}_{band} * common[{i}].clamp"]
    return [f"    {line}" for line in lines]


def _grow(pattern: Pattern, rows: Workspace) -> list[str]:
    """Return P = F P F' + Q."""
    n, lines = pattern.n, list(load(rows, covariance_names(pattern.n)))
    lines += [
        f"w{i}_{j} = {added(f'f{i}_{m} * {entry(m, j)}' for m in pattern.F[i])}" for i in range(n) for j in range(n)
    ]
    lines += [
        f"{rows.at(entry(i, j))} = q{i}_{j} + {added(f'w{i}_{m} * f{j}_{m}' for m in pattern.F[j])}"
        for i in range(n)
        for j in range(i + 1)
    ]
    return lines


def _project(pattern: Pattern, i: int) -> list[str]:
    """Return g = P H_i' and its innovation's spread."""
    g = [f"g{j} = {added(f'h{i}_{m} * {entry(m, j)}' for m in pattern.H[i])}" for j in range(pattern.n)]
    return [*g, f"spread = {added(f'h{i}_{j} * g{j}' for j in pattern.H[i])}"]


def _observe(pattern: Pattern, rows: Workspace, i: int) -> list[str]:
    """Return what `covariance.observe` does: N_k, band, R in force, S, before any reading of the instant is used."""
    memory = {name: rows.at(f"{name}_{i}") for name in MEMORY}
    z, one = rows.at(f"z{i}"), f"common[{i}]"
    scalars = [
        f"one = {one}",
        f"fresh = seen[{i}] > 0",
        "if fresh:",
        "    one.increments += 1",
        "weight = max(1.0 / max(one.increments, 1), one.least_weight) if fresh else 0.0",
        "judged = one.banded and one.increments >= one.wait",
        "valid = fresh or not one.difference",
        "half, whole = (0.5, 1.0) if one.difference else (1.0, 0.0)",
    ]
    lines = [f"            {line}" for line in scalars]
    lines += over_lanes(12, [f"{z} = Z[{i}, k, s]"])
    body = [
        *load(rows, [*state_names(pattern.n), *covariance_names(pattern.n)]),
        *_project(pattern, i),
        f"e = {z}{less_seen(pattern, i)}",
        f"R = {memory['R']}",
        f"{rows.at('beyond')} = max({rows.at('beyond')}, e * e - {GATE**2!r} * (spread + R))",
        f"step = {z} - ({memory['reading']} if fresh else {z})",
        f"increment = {memory['increment']} + weight * (0.5 * step * step - {memory['increment']})",
        f"{memory['reading']} = {z}",
        f"{memory['increment']} = increment",
        f"band = (1.0 if increment >= low{i} else 0.0) + (1.0 if increment >= high{i} else 0.0)",
        f"moved = judged and band != {memory['band']}",
        *(f"{name} = {_of_band(name, i)}" for name in ("level", "lowest", "highest")),
        "R = level if moved else R",
        f"{memory['R']} = R",
        f"{memory['lowest']} = lowest if moved else {memory['lowest']}",
        f"{memory['highest']} = highest if moved else {memory['highest']}",
        f"{memory['band']} = band if moved else {memory['band']}",
        f"before = {memory['innovation']} if fresh else 0.0",
        "square = e - whole * before",
        f"{rows.at(f'square{i}')} = half * square * square",
        f"{rows.at(f'spread{i}')} = spread",
        f"{rows.at(f'used{i}')} = R",
        f"{memory['innovation']} = e",
        f"innovation[{i}, k, s] = e",
        f"variance[{i}, k, s] = spread + R",
    ]
    lines += over_lanes(12, body)
    total, square = memory["window"], rows.at(f"square{i}")
    slide = [
        f"{total} = {total} + ({square} - windows[{i}, at, s])",
        f"windows[{i}, at, s] = {square}",
    ]
    scale = [
        f"mean = {total} / n_seen",
        f"C = {rows.at(f'spread{i}')} + {memory['R']}",
        f"{rows.at(f'used{i}')} = {rows.at(f'used{i}')} * max(1.0, alpha * mean / C)",
    ]
    lines += [
        "            if one.alpha != 0.0 and valid:",
        "                alpha, at = one.alpha, one.window_count % n_window",
        "                one.window_count += 1",
        "                n_seen = float(min(one.window_count, n_window))",
        *over_lanes(16, slide),
        "                if at == n_window - 1:",
        *over_lanes(20, [f"{total} = 0.0"]),
        "                    for b in range(n_window):",
        *over_lanes(24, [f"{total} = {total} + windows[{i}, b, s]"]),
        *over_lanes(16, scale),
    ]
    return lines


def _of_band(name: str, i: int) -> str:
    """Return what `_bands` gave the band that an increment is in."""
    return f"({name}{i}_0 if increment < low{i} else {name}{i}_1) if increment < high{i} else {name}{i}_2"


def _use(pattern: Pattern, rows: Workspace, i: int) -> list[str]:
    """Return what `covariance.update` and `covariance.learn` do: the reading is used, then R adapts."""
    n, memory = pattern.n, {name: rows.at(f"{name}_{i}") for name in MEMORY}
    pairs = [(a, b) for a in range(n) for b in range(n)]
    body = [
        *load(rows, [*state_names(n), *covariance_names(n)]),
        *_project(pattern, i),
        f"R = {rows.at(f'used{i}')}",
        f"e = {rows.at(f'z{i}')}{less_seen(pattern, i)}",
        "C = spread + R",
        *(f"k{j} = g{j} / C" for j in range(n)),
        *(f"{rows.at(f'x{j}')} = x{j} + k{j} * e" for j in range(n)),
        *(f"a{a}_{b} = {entry(a, b)} - k{a} * g{b}" for a, b in pairs),
        *(f"t{j} = {added(f'h{i}_{m} * a{m}_{j}' for m in pattern.H[i])} - R * k{j}" for j in range(n)),
        *(f"{rows.at(entry(a, b))} = a{a}_{b} - t{a} * k{b}" for a, b in pairs if b <= a),
    ]
    learn = [
        f"R = (1.0 - d) * {memory['R']} + d * ({rows.at(f'square{i}')} - {rows.at(f'spread{i}')})",
        f"below, above = R < {memory['lowest']}, R > {memory['highest']}",
        f"{memory['hits']} = {memory['hits']} + (1.0 if below or above else 0.0)",
        f"R = {memory['lowest']} if below else R",
        f"{memory['R']} = {memory['highest']} if above and not below else R",
    ]
    return [
        *over_lanes(12, body),
        f"            one = common[{i}]",
        f"            if one.adapt_R and (not one.difference or seen[{i}] > 0):",
        "                one.power *= one.forget",
        "                d = (1.0 - one.forget) / (1.0 - one.power)",
        *over_lanes(16, learn),
        f"            seen[{i}] += 1",
    ]
