"""Draws bound-711.svg beside this file from the lines `csv,...` that the tests of the global bound print:

    cargo test --release -p membranes --test numerics -- global_bound --nocapture --test-threads 1 | python3 docs/pictures/bound-711.py
"""

import math
import pathlib
import sys

# Name in the file, label, colour, width.
CURVES = [
    ("bound_711", "(7.11) as it stands", "#c0392b", 2.4),
    ("bound_711_repaired", "(7.11) repaired", "#1f77b4", 2.4),
    ("eta_K", "eta_K, root of the sum of squares", "#7f7f7f", 1.4),
    ("eta_e_sum", "sum of eta_e", "#e67e22", 1.4),
    ("error", "true error", "#2c3e50", 2.4),
]
TITLES = {"P2": "P2: square, action continuous", "P1": "P1: disk, action jumps"}
WIDTH, HEIGHT, LEFT, TOP, BOTTOM, GAP = 400, 330, 62, 34, 74, 62


def read(lines):
    names, cases = None, {}
    for line in lines:
        # The name of the test may stand before the first line that it prints.
        at = line.find("csv,")
        if at < 0:
            continue
        cells = line[at:].strip().split(",")[1:]
        if cells[0] == "case":
            names = cells
        else:
            row = dict(zip(names, cells))
            cases.setdefault(row["case"], []).append({k: float(v) for k, v in row.items() if k != "case"})
    return cases


def panel(case, rows, x0):
    xs = [row["vertices"] for row in rows]
    values = [row[name] for row in rows for name, *_ in CURVES]
    low, high = 10 ** math.floor(math.log10(min(values))), 10 ** math.ceil(math.log10(max(values)))
    start, end = 10 ** math.floor(math.log10(min(xs))), 10 ** math.ceil(math.log10(max(xs)))

    def x(v):
        return x0 + WIDTH * math.log(v / start) / math.log(end / start)

    def y(v):
        return TOP + HEIGHT * math.log(high / v) / math.log(high / low)

    out = [f'<rect x="{x0}" y="{TOP}" width="{WIDTH}" height="{HEIGHT}" fill="none" stroke="#444"/>']
    out.append(f'<text x="{x0 + WIDTH / 2}" y="{TOP - 12}" text-anchor="middle" font-weight="bold">{TITLES[case]}</text>')
    for horizontal, first, last in ((True, low, high), (False, start, end)):
        for k in range(round(math.log10(first)), round(math.log10(last)) + 1):
            v = 10.0**k
            power = f'10<tspan dy="-5" font-size="9">{k}</tspan>'
            if horizontal:
                out.append(f'<path d="M{x0} {y(v):.1f}h{WIDTH}" stroke="#ddd"/>')
                out.append(f'<text x="{x0 - 7}" y="{y(v) + 4:.1f}" text-anchor="end">{power}</text>')
            else:
                out.append(f'<path d="M{x(v):.1f} {TOP}v{HEIGHT}" stroke="#ddd"/>')
                out.append(f'<text x="{x(v):.1f}" y="{TOP + HEIGHT + 18}" text-anchor="middle">{power}</text>')
    out.append(f'<text x="{x0 + WIDTH / 2}" y="{TOP + HEIGHT + 34}" text-anchor="middle">vertices</text>')
    for name, _, colour, width in CURVES:
        points = [(x(row["vertices"]), y(row[name])) for row in rows]
        path = "L".join(f"{a:.1f} {b:.1f}" for a, b in points)
        out.append(f'<path d="M{path}" fill="none" stroke="{colour}" stroke-width="{width}"/>')
        out += [f'<circle cx="{a:.1f}" cy="{b:.1f}" r="3" fill="{colour}"/>' for a, b in points]
    return out


def main():
    cases = read(sys.stdin)
    total = LEFT + 2 * WIDTH + GAP + 18
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{total}" height="{TOP + HEIGHT + BOTTOM}" '
        f'viewBox="0 0 {total} {TOP + HEIGHT + BOTTOM}" font-family="sans-serif" font-size="12">',
        '<rect width="100%" height="100%" fill="white"/>',
    ]
    for i, case in enumerate(TITLES):
        out += panel(case, cases[case], LEFT + i * (WIDTH + GAP))
    at = LEFT
    for _, label, colour, width in CURVES:
        y = TOP + HEIGHT + 58
        out.append(f'<path d="M{at} {y}h22" stroke="{colour}" stroke-width="{width}"/>')
        out.append(f'<text x="{at + 28}" y="{y + 4}">{label}</text>')
        at += 52 + 6.6 * len(label)
    out.append("</svg>")
    path = pathlib.Path(__file__).with_suffix(".svg")
    path.write_text("\n".join(out) + "\n", encoding="utf-8")
    print(path)


main()
