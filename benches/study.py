"""Processor seconds to a true error of 1 % and of 0.3 %, for `children` 2 and 4 and `theta` from 0.3 to 0.9, on the scenes in benches/study/.

    cargo build --release -p membranes
    python3 benches/study.py target/release/membranes

Prints the section "children and theta" of docs/cost.md; `--write` puts it there. `--repeat 3` takes the least of three times. Python's standard library only.

Every choice is run with the known solution first, which tells the level whose true error, relative to the energy norm, first meets the goal; then without it,
to the number of vertices of that level. True errors cost many times the run itself, so they are computed to the first goal only; the level that meets the second
is told by the residual bound, divided by its quotient to the true error on the last level where that is known. `--full` computes them to the end. The second run is timed: the whole process, one thread, residual estimator, history and summary written, no fields.
Levels do not meet a goal exactly. The error falls like the root of the number of vertices and a run costs the same for every vertex, so the seconds that are
compared are those measured times the square of (error reached / goal).
"""

import argparse
import csv
import math
import pathlib
import resource
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
COST = HERE.parent / "docs" / "cost.md"
SCENES = {"P2": "square, continuous action", "P8": "square, action jumps", "P3": "L-shape"}
GOALS = [0.01, 0.003]
CHILDREN = [2, 4]
THETAS = [0.3, 0.5, 0.6, 0.7, 0.8, 0.9]
DEFAULT = (4, 0.5)
TITLE = "## children and theta"
FIRST = 20_000


class Program:
    """The program, run in a folder of its own."""

    def __init__(self, path, folder):
        self.path, self.folder = path, pathlib.Path(folder)

    def plain(self, scene):
        """The scene without its known solution, as a file."""
        text = (HERE / "study" / f"{scene}.toml").read_text(encoding="utf-8")
        start = text.index("[exact]")
        end = text.index("[estimate]")
        path = self.folder / f"{scene}.toml"
        path.write_text(text[:start] + text[end:], encoding="utf-8")
        return path

    def measure(self, scene, keys, threads=1):
        """One run with the keys `keys`; wall seconds, processor seconds and the history."""
        out = self.folder / "out"
        command = [self.path, "run", str(scene), "--out", str(out), "--force", "--quiet", "--threads", str(threads)]
        command += [word for key in keys for word in ("--set", key)]
        before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        done = subprocess.run(command, stdout=subprocess.DEVNULL)
        wall, after = time.perf_counter() - begun, resource.getrusage(resource.RUSAGE_CHILDREN)
        # A goal was reached, or a limit.
        if done.returncode != 0:
            sys.exit(f"{' '.join(map(str, command))}: exit code {done.returncode}")
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        with open(out / "history.csv", encoding="utf-8", newline="") as file:
            return wall, seconds, list(csv.DictReader(file))

    def run(self, scene, children, theta, rule):
        """Runs until the rule holds; processor seconds and the history."""
        return self.measure(scene, ["stop={}", rule, f"mark.children={children}", f"mark.theta={theta}"])[1:]


def known(program, scene, children, theta, least):
    """Levels of a run with the known solution until the true error is at most `least`: vertices, relative true error, bound over true error."""
    file, vertices = HERE / "study" / f"{scene}.toml", FIRST
    while True:
        history = program.run(file, children, theta, f"stop.vertices={vertices}")[1]
        seen = []
        for row in history:
            error = float(row["true_error"])
            seen.append((int(row["vertices"]), error / float(row["energy_norm"]), float(row["error_bound"]) / error))
        n, error, _ = seen[-1]
        if error <= least:
            return seen
        vertices = math.ceil(1.02 * n * (error / least) ** 2)


def timed(program, plain, choice, seen, goal, repeat):
    """Runs without the known solution to the level that first meets the goal: levels, vertices, error, seconds, and by what the last level grew."""
    met = next(((n, e) for n, e, _ in seen if e <= goal), None)
    ratio = seen[-1][2]
    # The level is known, or told by the bound that belongs to the goal.
    rule = f"stop.vertices={met[0]}" if met else f"stop.relative_error={goal * ratio}"
    runs = [program.run(plain, *choice, rule) for _ in range(repeat)]
    history = runs[0][1]
    error = met[1] if met else float(history[-1]["relative_bound"]) / ratio
    vertices = [int(row["vertices"]) for row in history]
    return len(history), vertices[-1], error, min(seconds for seconds, _ in runs), vertices[-1] / vertices[-2]


def study(program, scenes, repeat, least):
    """{(scene, goal): {(children, theta): (levels, vertices, error, seconds, growth)}}"""
    table = {}
    for scene in scenes:
        plain = program.plain(scene)
        for choice in ((c, t) for c in CHILDREN for t in THETAS):
            seen = known(program, scene, *choice, least)
            for goal in GOALS:
                entry = timed(program, plain, choice, seen, goal, repeat)
                table.setdefault((scene, goal), {})[choice] = entry
                print(scene, *choice, goal, *entry, file=sys.stderr, flush=True)
    return table


def compared(goal, entry):
    """Seconds as if a level met the goal exactly."""
    _, _, error, seconds, _ = entry
    return seconds * (error / goal) ** 2


def expected(goal, entry):
    """The mean over goals that fall anywhere between two levels: the level that meets them has more vertices than they ask for, up to the whole growth."""
    growth = entry[-1]
    return compared(goal, entry) * (growth - 1) / math.log(growth)


def means_of(table, seconds):
    """The geometric mean over all columns of the ratio to the best of the column."""
    choices = list(next(iter(table.values())))
    logs = dict.fromkeys(choices, 0.0)
    for (_, goal), entries in table.items():
        best = min(seconds(goal, e) for e in entries.values())
        for choice in choices:
            logs[choice] += math.log(seconds(goal, entries[choice]) / best) / len(table)
    return {choice: math.exp(log) for choice, log in logs.items()}


def section(table, repeat):
    out = [TITLE, ""]
    out.append("```console\ncargo build --release -p membranes\n" f"python3 benches/study.py target/release/membranes --repeat {repeat} --write\n```\n")
    out.append(
        "Processor seconds of the whole process, one thread, residual estimator, no fields, to the first level whose true error relative to the energy norm meets the goal: "
        f"the least of {repeat}. Levels do\nnot meet a goal exactly, so the seconds that are compared are those measured times (error reached / goal)^2, since the error falls like the "
        "root of the number of vertices and a\nrun costs the same for every vertex. The error at the second goal is that of the residual bound, divided by the bound's quotient to the true error at the first. In brackets: levels, vertices of the last one. The least of a column is bold.\n"
    )
    columns = list(table)
    heads = [f"{scene}, {100 * goal:g} %" for scene, goal in columns]
    out.append("| children | theta | " + " | ".join(heads) + " | mean ratio to the best | the same with what goes beyond a goal |")
    out.append("|---|---|" + "---|" * (len(columns) + 2))
    exact, whole = means_of(table, compared), means_of(table, expected)
    for choice in ((c, t) for c in CHILDREN for t in THETAS):
        cells = []
        for column in columns:
            entry, best = table[column][choice], min(compared(column[1], e) for e in table[column].values())
            seconds = compared(column[1], entry)
            text = f"**{seconds:.3f}**" if seconds == best else f"{seconds:.3f}"
            cells.append(f"{text} ({entry[0]}, {entry[1]})")
        out.append(f"| {choice[0]} | {choice[1]} | " + " | ".join(cells) + f" | {exact[choice]:.2f} | {whole[choice]:.2f} |")
    winner, best = min(exact, key=exact.get), min(whole, key=whole.get)
    scenes = "; ".join(f"{name}: {what}" for name, what in SCENES.items())
    out.append(f"\n{scenes}. The means are geometric ones over the columns.\n")
    out.append(
        "A run ends on a level that goes beyond its goal: with growth r of the vertices in the last level, by (r - 1)/log r in the mean over goals that fall anywhere between two levels. "
        "The last column\ncounts that, as anybody does who waits for a result. To a level that meets a goal exactly "
        f"`children = {winner[0]}`, `theta = {winner[1]}` is fastest; to a goal `children = {best[0]}`, `theta = {best[1]}` "
        f"with {whole[best]:.2f}.\nThe default, `children = {DEFAULT[0]}`, `theta = {DEFAULT[1]}`, has {exact[DEFAULT]:.2f} and {whole[DEFAULT]:.2f}; it is kept\nwhere it is the slower one, since more levels, closer to one another, also are what convergence is read off, and scenes rely on it."
        + (" Taken once, on a machine that changed its pace: differences below a fifth mean nothing." if repeat == 1 else "")
    )
    return "\n".join(out) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program")
    parser.add_argument("--repeat", type=int, default=1)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--scenes", default=",".join(SCENES))
    parser.add_argument("--full", action="store_true")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        least = min(GOALS) if arguments.full else max(GOALS)
        table = study(Program(arguments.program, folder), arguments.scenes.split(","), arguments.repeat, least)
    text = section(table, arguments.repeat)
    print(text, end="")
    if arguments.write:
        page = COST.read_text(encoding="utf-8")
        start = page.find(TITLE)
        if start < 0:
            page = page.rstrip("\n") + "\n\n" + text
        else:
            end = page.find("\n## ", start + 1)
            page = page[:start] + text + (page[end:] if end >= 0 else "")
        COST.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
