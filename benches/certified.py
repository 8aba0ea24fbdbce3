"""What the certificate costs: a run to a certified relative error of 0.5 %, beside a run by the residual estimator to the same true error.

    cargo build --release -p membranes
    python3 benches/certified.py target/release/membranes --repeat 3

Scene P2 of benches/study/ (two constant tensions, loads as formulas), `final = "fast"`, on one thread and on two, in turn; the least times of `--repeat` count. Both runs are made
once more with the known solution, not timed, for their true errors. The run by the residual estimator ends on the first level with as many vertices as the certified one has;
its seconds are compared after multiplication by the square of its error over the other's, since the error falls like the root of the number of vertices and a run costs the same
for every vertex. Python's standard library only.
"""

import argparse
import tempfile

from study import HERE, Program

CERTIFIED = ['estimate.estimator="certified"', 'estimate.final="fast"', "stop={}", "stop.relative_error=0.005"]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program")
    parser.add_argument("--repeat", type=int, default=1)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        exact = HERE / "study" / "P2.toml"
        program = Program(arguments.program, folder)
        plain = program.plain("P2")
        vertices = int(program.measure(plain, CERTIFIED)[2][-1]["vertices"])
        residual = ["stop={}", f"stop.vertices={vertices}"]
        error = {name: float(program.measure(exact, keys)[2][-1]["true_error"]) for name, keys in (("certified", CERTIFIED), ("residual", residual))}
        print("| threads | run | vertices | bound | true error | wall s | processor s | times the other, to the same true error |")
        print("|---|---|---|---|---|---|---|---|")
        for threads in (1, 2):
            best = {}
            for _ in range(arguments.repeat):
                for name, keys in (("certified", CERTIFIED), ("residual", residual)):
                    wall, processor, history = program.measure(plain, keys, threads)
                    old = best.get(name, (wall, processor))
                    best[name] = (min(wall, old[0]), min(processor, old[1]), history[-1])
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
