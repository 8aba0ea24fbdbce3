"""Draws growth.svg beside this file from the lines `csv,...` that the bench of the whole run hands over:

    cargo bench -p membranes --bench growth -- --to 1e7 --repeat 2 --only constant/square --plot
"""

import math
import pathlib
import sys

# Name of the scene, label, colour.
CURVES = [
    ("constant", "L-shape, constant loads", "#1f77b4"),
    ("square", "square, loads are formulas", "#c0392b"),
    ("two_fields", "two fields, formulas", "#2e8b57"),
]
WIDTH, HEIGHT, LEFT, TOP, RIGHT, BOTTOM = 560, 300, 62, 20, 62, 66


def read(lines):
    names, curves = None, {}
    for line in lines:
        cells = line.strip().split(",")
        if cells[0] != "csv":
            continue
        if cells[1] == "scene":
            names = cells[2:]
        else:
            curves.setdefault(cells[1], []).append(dict(zip(names, map(float, cells[2:]))))
    return curves


def step(top):
    """A round distance of grid lines for an axis from 0 to `top`."""
    power = 10.0 ** math.floor(math.log10(top / 4))
    return next(k * power for k in (1, 2, 5, 10) if k * power >= top / 6)


def main():
    curves = read(sys.stdin)
    drawn = [curve for curve in CURVES if curve[0] in curves]
    rows = [row for name, *_ in drawn for row in curves[name]]
    start = 10 ** math.floor(math.log10(min(r["vertices"] for r in rows)))
    end = 2 * max(r["vertices"] for r in rows)
    top = 1.1 * max(r["microseconds"] for r in rows)
    # A product's microseconds a row: the right-hand axis is the left one in that unit.
    product = rows[0]["microseconds"] / rows[0]["products"]

    def x(v):
        return LEFT + WIDTH * math.log(v / start) / math.log(end / start)

    def y(v):
        return TOP + HEIGHT * (1 - v / top)

    total, high = LEFT + WIDTH + RIGHT, TOP + HEIGHT + BOTTOM
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{total}" height="{high}" viewBox="0 0 {total} {high}" '
        'font-family="sans-serif" font-size="12">',
        '<rect width="100%" height="100%" fill="white"/>',
    ]
    for k in range(round(math.log10(start)), math.floor(math.log10(end)) + 1):
        at = x(10.0**k)
        out.append(f'<path d="M{at:.1f} {TOP}v{HEIGHT}" stroke="#ddd"/>')
        out.append(
            f'<text x="{at:.1f}" y="{TOP + HEIGHT + 18}" text-anchor="middle">10<tspan dy="-5" font-size="9">{k}</tspan></text>'
        )
    for unit, horizontal, anchor in ((1.0, LEFT - 7, "end"), (product, LEFT + WIDTH + 7, "start")):
        distance = step(top / unit)
        for k in range(math.floor(top / unit / distance) + 1):
            at = y(k * distance * unit)
            if unit == 1.0:
                out.append(f'<path d="M{LEFT} {at:.1f}h{WIDTH}" stroke="#ddd"/>')
            out.append(f'<text x="{horizontal}" y="{at + 4:.1f}" text-anchor="{anchor}">{k * distance:g}</text>')
    middle = TOP + HEIGHT / 2
    for at, text in ((16, "microseconds a vertex"), (total - 12, "sparse products a vertex")):
        out.append(f'<text x="{at}" y="{middle}" text-anchor="middle" transform="rotate(-90 {at} {middle})">{text}</text>')
    out.append(f'<rect x="{LEFT}" y="{TOP}" width="{WIDTH}" height="{HEIGHT}" fill="none" stroke="#444"/>')
    out.append(f'<text x="{LEFT + WIDTH / 2}" y="{TOP + HEIGHT + 34}" text-anchor="middle">vertices of the last mesh</text>')
    at = LEFT
    for name, label, colour in drawn:
        points = [(x(r["vertices"]), y(r["microseconds"])) for r in curves[name]]
        path = "L".join(f"{a:.1f} {b:.1f}" for a, b in points)
        out.append(f'<path d="M{path}" fill="none" stroke="{colour}" stroke-width="2"/>')
        out += [f'<circle cx="{a:.1f}" cy="{b:.1f}" r="3" fill="{colour}"/>' for a, b in points]
        out.append(f'<path d="M{at} {high - 12}h22" stroke="{colour}" stroke-width="2"/>')
        out.append(f'<text x="{at + 28}" y="{high - 8}">{label}</text>')
        at += 60 + 6.6 * len(label)
    out.append("</svg>")
    path = pathlib.Path(__file__).with_suffix(".svg")
    path.write_text("\n".join(out) + "\n", encoding="utf-8")
    print(path)


main()
