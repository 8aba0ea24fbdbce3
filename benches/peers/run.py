"""Compares `membranes` with the programs people use instead, on one scene, to the same true error.

    cargo build --release
    benches/peers/install.sh
    python3 benches/peers/run.py --target 0.005

Whole processes on one thread each, in turn, the best of `--repeat` rounds. The peers evaluate the true error after every level, and what
that costs is taken off their times; `membranes` is told beforehand, by a run that is not timed, how many vertices it needs. The table goes
to standard output and into docs/peers.md, every line of every program to target/peers/results.json.
"""

import argparse
import csv
import io
import json
import math
import os
import pathlib
import platform
import re
import shutil
import subprocess
import tempfile
import time
import tokenize
import tomllib

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
SCRATCH = ROOT / "target" / "peers"
VENV = str(SCRATCH / "venv" / "bin" / "python")
DEBIAN = "/usr/bin/python3"
MILESTONES = [0.05, 0.02, 0.01, 0.005]
THREADS = ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"]
ONE_THREAD = os.environ | {name: "1" for name in THREADS}


def peer(program, refinement, solver, command, name, *options):
    return {
        "program": program,
        "refinement": refinement,
        "solver": solver,
        "command": [*command, str(HERE / name), *options],
        "source": HERE / name,
        "dash": "-" if name.endswith("edp") else "--",
    }


FREEFEM = ["FreeFem++-nw", "-v", "0"]
PEERS = [
    peer("PETSc under dolfinx", "bisection", "tao-tron, hypre", [DEBIAN], "peer_petsc.py", "--solver", "tron"),
    peer(
        "PETSc under dolfinx", "bisection", "vinewtonrsls, hypre", [DEBIAN], "peer_petsc.py", "--solver", "vinewtonrsls"
    ),
    peer("NGSolve", "bisection", "active set, multigrid", [VENV], "peer_ngsolve.py", "--solver", "multigrid"),
    peer("NGSolve", "bisection", "active set, sparsecholesky", [VENV], "peer_ngsolve.py", "--solver", "sparsecholesky"),
    peer("NGSolve", "bisection", "active set, pardiso", [VENV], "peer_ngsolve.py", "--solver", "pardiso"),
    peer("FreeFEM", "remeshing, anisotropic", "active set, CHOLMOD", FREEFEM, "peer_freefem.edp", "-solver", "CHOLMOD"),
    peer("FreeFEM", "remeshing, isotropic", "active set, CHOLMOD", FREEFEM, "peer_freefem.edp", "-isotropic", "1"),
    peer("scikit-fem", "red-green-blue", "active set, pyamg", [VENV], "peer_scikit_fem.py", "--solver", "pyamg"),
    peer("scikit-fem", "red-green-blue", "active set, CHOLMOD", [VENV], "peer_scikit_fem.py", "--solver", "cholmod"),
]


def count_lines(path):
    """Lines a user must write: not blank, no comment, no docstring, nothing that only serves the comparison."""
    text = path.read_text()
    text = re.sub(r"^[ \t]*// harness.*?// end of harness", "", text, flags=re.S | re.M)
    if path.suffix != ".py":
        lines = (line.strip() for line in text.splitlines())
        return sum(bool(line) and not line.startswith(("//", "#")) for line in lines)
    blank = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
    used, fresh = set(), True
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type in blank:
            fresh = fresh or token.type == tokenize.NEWLINE
        elif not (fresh and token.type == tokenize.STRING):
            fresh = False
            used.update(range(token.start[0], token.end[0] + 1))
    rows = text.splitlines()
    return sum("harness" not in rows[k - 1].lower() for k in used)


def measure(command, log=None):
    """Runs a process; its standard output, CPU seconds (user and system), wall seconds and peak memory in MiB."""
    with open(log or os.devnull, "a") as errors:
        start = time.monotonic()
        process = subprocess.Popen(command, env=ONE_THREAD, stdout=subprocess.PIPE, stderr=errors, text=True)
        output = process.stdout.read()
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.monotonic() - start
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"{' '.join(command)}: exit code {process.returncode}, see {log}")
    return output, {"cpu": usage.ru_utime + usage.ru_stime, "wall": wall, "peak_mb": usage.ru_maxrss / 1024}


# A program runs this often in a round at most, and no more once so many seconds are spent: what else the machine does can double a
# run of a second, and hardly touches one of half a minute.
ATTEMPTS, ENOUGH = 5, 10.0


# Runs of ours before and after every peer; the least of each counts.
BESIDE = 2


def fastest(run):
    """The run of least CPU seconds among those of a round."""
    best, spent = None, 0.0
    for _ in range(ATTEMPTS):
        result = run()
        spent += result["wall"]
        if best is None or result["cpu"] < best["cpu"]:
            best = result
        if spent >= ENOUGH:
            break
    return best


def run_peer(peer, target):
    """One run: the levels it printed, and the whole process without what the true errors cost."""
    output, whole = measure([*peer["command"], peer["dash"] + "target", str(target)], SCRATCH / "errors.log")
    *levels, last = [json.loads(line) for line in output.splitlines() if line.startswith("{")]
    for key in ("cpu", "wall"):
        whole[key] -= last[key + "_all"] - last[key]
    return {"levels": levels, "versions": last["versions"], **whole}


class Ours:
    """The scene run by `membranes`, with and without its exact solution."""

    def __init__(self, binary):
        self.binary = str(binary)
        help_text = subprocess.run([self.binary, "run", "--help"], capture_output=True, text=True).stdout
        self.threads = ["--threads", "1"] if "--threads" in help_text else []
        self.version = subprocess.run([self.binary, "--version"], capture_output=True, text=True).stdout.strip()
        self.folder = pathlib.Path(tempfile.mkdtemp(dir=SCRATCH))
        self.scene = HERE / "square.toml"
        exact = tomllib.loads((ROOT / "configs" / "square.toml").read_text())["exact"]
        self.known = self.folder / "known.toml"
        self.known.write_text(
            self.scene.read_text() + f'\n[exact]\nupper = "{exact["upper"]}"\nlower = "{exact["lower"]}"\n'
        )

    def run(self, scene, vertices):
        out = str(self.folder / "run")
        command = [self.binary, "run", str(scene), "--quiet", "--force", "--out", out, *self.threads]
        _, whole = measure([*command, "--set", f"stop.vertices={vertices}"], SCRATCH / "errors.log")
        with open(out + "/history.csv") as history:
            return list(csv.DictReader(history)), whole

    def levels(self, target):
        """Vertices and true errors of the levels up to the first that meets the target."""
        vertices = round(0.6e6 * (0.005 / target) ** 2)
        while True:
            rows, _ = self.run(self.known, vertices)
            levels = [{"vertices": int(row["vertices"]), "h1_error": float(row["h1_error"])} for row in rows]
            for index, level in enumerate(levels):
                if level["h1_error"] <= target:
                    return levels[: index + 1]
            vertices *= 2


def interpolate(levels, target, key):
    """`key` at the error `target`, linear in logarithms between the levels around it; None before the first or after the last."""
    for before, after in zip(levels, levels[1:]):
        if after["h1_error"] <= target < before["h1_error"]:
            share = math.log(before["h1_error"] / target) / math.log(before["h1_error"] / after["h1_error"])
            return before[key] * (after[key] / before[key]) ** share
    return None


def triad():
    """GB/s of one core, or None without a C compiler."""
    program = str(SCRATCH / "triad")
    compiler = shutil.which("cc") or shutil.which("gcc")
    if (
        not compiler
        or subprocess.run([compiler, "-O3", "-march=native", str(HERE / "triad.c"), "-o", program]).returncode
    ):
        return None
    return float(subprocess.run([program], capture_output=True, text=True, check=True).stdout)


def processor():
    with open("/proc/cpuinfo") as lines:
        return next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), platform.machine())


def installed(peer):
    """A coarse run; it also lets dolfinx compile its forms, which it does once and keeps."""
    if not shutil.which(peer["command"][0]):
        return False
    try:
        return bool(run_peer(peer, 0.2)["levels"])
    except (RuntimeError, ValueError):
        return False


def table(results, absent, here, target):
    ours = results[0]
    lines = [
        f"| program | refinement | solver | vertices | true error | CPU s | ours beside it | times ours | interpolated to {target:g}: vertices"
        " | CPU s | times ours | wall s | peak MiB | lines |",
        "|" + "---|" * 14,
    ]
    for r in results:
        last = r["levels"][-1]
        # Against runs of ours before and after it: a shared machine changes its pace within minutes.
        beside = r.get("beside", ours["cpu"])
        exact = r["exact_cpu"] / (ours["exact_cpu"] * beside / ours["cpu"])
        lines.append(
            f"| {r['program']} | {r['refinement']} | {r['solver']} | {last['vertices']} | {last['h1_error']:.5f} | {r['cpu']:.2f} |"
            f" {beside:.2f} | {r['cpu'] / beside:.1f} | {r['exact_vertices']:.0f} | {r['exact_cpu']:.2f} | {exact:.1f} | {r['wall']:.2f} |"
            f" {r['peak_mb']:.0f} | {r['lines']} |"
        )
    lines += [
        f"| {p['program']} | {p['refinement']} | {p['solver']} | {'failed' if p in here else 'not installed here'} |"
        + " |" * 10
        for p in absent
    ]
    milestones = [m for m in MILESTONES if m >= target]
    lines += [
        "",
        "On the way, interpolated between levels: vertices, and CPU seconds since the start of the process.",
        "",
        "| program | solver |" + "".join(f" {m:g} |" for m in milestones),
        "|" + "---|" * (2 + len(milestones)),
    ]
    for r in results:
        cells = []
        for m in milestones:
            vertices, cpu = (
                interpolate(r["levels"], m, key) if key in r["levels"][0] else None for key in ("vertices", "cpu")
            )
            cells.append("" if vertices is None else f"{vertices:.0f}" + ("" if cpu is None else f", {cpu:.2f}"))
        lines.append(f"| {r['program']}, {r['refinement']} | {r['solver']} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def report(ours, here, absent, best, before, bandwidth, rounds, options):
    """The table of what is known so far, printed and written to the page; every line to results.json."""
    results = []
    names = {"program": "membranes", "refinement": "bisection", "solver": "multigrid", "source": ours.scene}
    absent = absent + [p for index, p in enumerate(here, 1) if index not in best]
    for index, described in enumerate([names, *here]):
        if index not in best:
            continue
        result = best[index] | {k: described[k] for k in ("program", "refinement", "solver")}
        result["lines"] = count_lines(described["source"])
        ends = [dict(level) for level in result["levels"][-2:]]
        if index == 0:
            ends[0]["cpu"], ends[1]["cpu"] = before, result["cpu"]
        for key in ("vertices", "cpu"):
            result["exact_" + key] = interpolate(ends, options.target, key)
        results.append(result)

    rates = [f"{rate:.1f}" for rate in bandwidth if rate]
    versions = sorted({f"{name} {version}" for r in results for name, version in r.get("versions", {}).items()})
    text = "\n".join(
        [
            f"Machine: {processor()}, {os.cpu_count()} cores; triad on one core, before and after: {' and '.join(rates) or 'not measured'} GB/s."
            f" {ours.version}; {', '.join(versions)}. Best of {rounds}.",
            "",
            table(results, absent, here, options.target),
        ]
    )
    (SCRATCH / "results.json").write_text(
        json.dumps({"target": options.target, "triad": bandwidth, "results": results}, indent=1)
    )
    print(text)
    if options.page.exists():
        page = options.page.read_text()
        marked = re.compile(r"(<!-- made by benches/peers/run.py -->\n).*?(<!-- end -->)", re.S)
        options.page.write_text(marked.sub(lambda m: f"{m[1]}\n{text}\n\n{m[2]}", page))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--target", type=float, default=0.005, help="true H1 error of both membranes to reach")
    parser.add_argument("--repeat", type=int, default=3, help="rounds; the best of each program counts")
    parser.add_argument("--only", default="", help="peers whose program or solver contains this text")
    target_folder = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    parser.add_argument("--binary", type=pathlib.Path, default=target_folder / "release" / "membranes")
    parser.add_argument(
        "--page", type=pathlib.Path, default=ROOT / "docs" / "peers.md", help="page to write the table into"
    )
    options = parser.parse_args()
    if options.target > 0.1:
        parser.error("a target above 0.1 is met by the first mesh")
    if not options.binary.exists():
        parser.error(f"{options.binary} is missing: cargo build --release")
    SCRATCH.mkdir(parents=True, exist_ok=True)
    (SCRATCH / "errors.log").write_text("")

    ours, bandwidth = Ours(options.binary.resolve()), [triad()]
    levels = ours.levels(options.target)
    wanted = [p for p in PEERS if options.only.lower() in (p["program"] + " " + p["solver"]).lower()]
    here = [p for p in wanted if installed(p)]
    absent = [p for p in wanted if p not in here]
    best, before = {}, None
    for round_ in range(options.repeat):
        own = lambda: ours.run(ours.scene, levels[-1]["vertices"])[1] | {"levels": levels}
        beside = lambda: min(own()["cpu"] for _ in range(BESIDE))
        coarser = fastest(lambda: ours.run(ours.scene, levels[-2]["vertices"])[1])
        before = min(before or coarser["cpu"], coarser["cpu"])
        runs = [("membranes", own)]
        runs += [(" ".join(p["command"][-3:]), lambda p=p: run_peer(p, options.target)) for p in here]
        for index, (name, run) in enumerate(runs):
            try:
                # Nothing is to be measured beside ours itself.
                before_it = beside() if index > 0 else None
                result = fastest(run)
                if before_it:
                    result["beside"] = 0.5 * (before_it + beside())
            except RuntimeError as error:  # too little memory, say: the others go on
                print(f"round {round_ + 1}: {error}", flush=True)
                continue
            print(f"round {round_ + 1}: {pathlib.Path(name).name}: {result['cpu']:.2f} s CPU", flush=True)
            if index not in best or result["cpu"] < best[index]["cpu"]:
                best[index] = result
        report(ours, here, absent, best, before, [*bandwidth, triad()], round_ + 1, options)
    shutil.rmtree(ours.folder)


if __name__ == "__main__":
    main()
