"""What the Python peers share and their users would not write: the true error, the clock, the lines on standard output.

Nothing in here solves anything. The clock runs from the start of the process (imports included) and stands still while the true error is
evaluated; both readings, with and without that pause, go out.
"""

import argparse
import json
import os
import resource
import time

import numpy as np

# Seven points, exact for polynomials of degree 5 (Strang and Fix).
_A, _B = 0.470142064105115, 0.101286507323456
_POINTS = [[1 / 3] * 3] + [
    [c if k == j else (1 - c) / 2 for k in range(3)] for c in (1 - 2 * _A, 1 - 2 * _B) for j in range(3)
]
_WEIGHTS = [0.225] + [0.132394152788506] * 3 + [0.125939180544827] * 3


def exact_gradients(x, y):
    """Gradients of u1 = p (1 + 2 q^2) and u2 = p (1 - q^2), p = (1 - x^2) (1 - y^2) / 3, q = max(x^2 + y^2 - 1/4, 0)."""
    a, b, q = 1 - x * x, 1 - y * y, np.maximum(x * x + y * y - 0.25, 0)
    p, p_x, p_y, q_x, q_y = a * b / 3, -2 * x * b / 3, -2 * y * a / 3, 2 * x, 2 * y
    return [(p_x * (1 + c * q * q) + 2 * c * p * q * q_x, p_y * (1 + c * q * q) + 2 * c * p * q * q_y) for c in (2, -1)]


def true_error(points, triangles, fields, block=1 << 15):
    """(|u1 - u1h|_1^2 + |u2 - u2h|_1^2)^(1/2) for P1 `fields` on `points` (n, 2) and `triangles` (m, 3), in blocks to spare memory."""
    total = 0.0
    for start in range(0, len(triangles), block):
        corners = triangles[start : start + block]
        p = points[corners]
        d1, d2 = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
        twice = d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]
        slopes = []
        for u in fields:
            v = u[corners]
            e1, e2 = v[:, 1] - v[:, 0], v[:, 2] - v[:, 0]
            slopes.append(((e1 * d2[:, 1] - e2 * d1[:, 1]) / twice, (e2 * d1[:, 0] - e1 * d2[:, 0]) / twice))
        for barycentric, weight in zip(_POINTS, _WEIGHTS):
            at = np.einsum("k,tkd->td", barycentric, p)
            for (gx, gy), (hx, hy) in zip(exact_gradients(at[:, 0], at[:, 1]), slopes):
                total += weight * np.dot(np.abs(twice) / 2, (gx - hx) ** 2 + (gy - hy) ** 2)
    return total**0.5


class Harness:
    """Reads the command line, watches the levels, says when to stop."""

    def __init__(self, solvers):
        parser = argparse.ArgumentParser()
        parser.add_argument("--target", type=float, default=0.005, help="true error to reach")
        parser.add_argument("--solver", choices=solvers, default=solvers[0])
        options = parser.parse_args()
        self.target, self.solver = options.target, options.solver
        self._level, self._cpu_pause, self._wall_pause = 0, 0.0, 0.0
        with open("/proc/self/stat") as stat:
            self._start = int(stat.read().rsplit(")", 1)[1].split()[19]) / os.sysconf("SC_CLK_TCK")

    def _clocks(self):
        return time.process_time(), time.clock_gettime(time.CLOCK_BOOTTIME) - self._start

    def reached(self, points, triangles, u1, u2, **more):
        """Prints the level's line; true once the true error is at most the target."""
        cpu, wall = self._clocks()
        error = true_error(np.asarray(points), np.asarray(triangles), (u1, u2))
        line = {
            "level": self._level,
            "vertices": len(points),
            "h1_error": error,
            "cpu": cpu - self._cpu_pause,
            "wall": wall - self._wall_pause,
            "cpu_all": cpu,
            "wall_all": wall,
            **more,
        }
        print(json.dumps(line), flush=True)
        after = self._clocks()
        self._cpu_pause += after[0] - cpu
        self._wall_pause += after[1] - wall
        self._level += 1
        return error <= self.target

    def finish(self, **versions):
        """The last line: the whole process, its peak memory, what was left out for the true error, versions."""
        cpu, wall = self._clocks()
        last = {
            "cpu": cpu - self._cpu_pause,
            "wall": wall - self._wall_pause,
            "cpu_all": cpu,
            "wall_all": wall,
            "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
            "versions": versions,
        }
        print(json.dumps(last), flush=True)
