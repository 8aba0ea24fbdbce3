"""What the certificate costs: a run to a certified relative error of 0.5 %, beside a run by the residual estimator to the same true error.

    cargo build --release -p membranes
    python3 benches/certified.py target/release/membranes --repeat 3

Scene P2 of benches/study/ (two constant tensions, loads as formulas), `final = "fast"`, on one thread and on two, in turn; the least times of `--repeat` count. Both runs are made
once more with the known solution, not timed, for their true errors. The run by the residual estimator ends on the first level with as many vertices as the certified one has;
its seconds are compared after multiplication by the square of its error over the other's, since the error falls like the root of the number of vertices and a run costs the same
for every vertex. Python's standard library only.
"""

import argparse
import csv
import pathlib
import resource
import subprocess
import sys
import tempfile
import time

from study import HERE, Program

CERTIFIED = ['estimate.estimator="certified"', 'estimate.final="fast"', "stop={}", "stop.relative_error=0.005"]


def timed(program, folder, scene, keys, threads):
    """Wall seconds, processor seconds and the last row of the history."""
    out = pathlib.Path(folder) / "out"
    command = [program, "run", str(scene), "--out", str(out), "--force", "--quiet", "--threads", str(threads)]
    command += [word for key in keys for word in ("--set", key)]
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    done = subprocess.run(command, stdout=subprocess.DEVNULL)
    wall, after = time.perf_counter() - begun, resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}: exit code {done.returncode}")
    with open(out / "history.csv", encoding="utf-8", newline="") as file:
        row = list(csv.DictReader(file))[-1]
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, row


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program")
    parser.add_argument("--repeat", type=int, default=1)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        exact = HERE / "study" / "P2.toml"
        plain = Program(arguments.program, folder).plain("P2")
        run = lambda scene, keys, threads=1: timed(arguments.program, folder, scene, keys, threads)
        vertices = int(run(plain, CERTIFIED)[2]["vertices"])
        residual = ["stop={}", f"stop.vertices={vertices}"]
        error = {name: float(run(exact, keys)[2]["true_error"]) for name, keys in (("certified", CERTIFIED), ("residual", residual))}
        print("| threads | run | vertices | bound | true error | wall s | processor s | times the other, to the same true error |")
        print("|---|---|---|---|---|---|---|---|")
        for threads in (1, 2):
            best = {}
            for _ in range(arguments.repeat):
                for name, keys in (("certified", CERTIFIED), ("residual", residual)):
                    wall, processor, row = run(plain, keys, threads)
                    old = best.get(name, (wall, processor, row))
                    best[name] = (min(wall, old[0]), min(processor, old[1]), row)
            for name, (wall, processor, row) in best.items():
                other = best["residual" if name == "certified" else "certified"]
                times = ""
                if name == "certified":
                    times = f"{wall / (other[0] * (error['residual'] / error['certified']) ** 2):.2f}"
                print(
                    f"| {threads} | {name} | {row['vertices']} | {100 * float(row['relative_bound']):.3f} % | {error[name]:.3e} | {wall:.2f} | {processor:.2f} | {times} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
