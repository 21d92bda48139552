"""Measure the cost per point of a branch: jaxcam, singly and in a batch, and AUTO-07p.

    python -m benchmarks.continuation
    JAX_COMPILATION_CACHE_DIR=$(mktemp -d) python -m benchmarks.continuation --cascade

The second command times one branch from an empty cache of compiled programs: from one
impact per period through grazing bifurcations to complete chatter.

Times are minimum CPU times of interleaved runs on one pinned core in float64, after a
first run for compilation. AUTO-07p (`auto`, Debian package auto-07p) is run for
comparison if it is installed.
"""

import argparse
import os
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

from benchmarks import _timing


CORE = _timing.pin()

import jax.numpy as jnp
import numpy as np

import continuation
from jaxcam.models import ImpactOscillator


# the cusp normal form, with its two folds: a minimal branch
def cusp(u, p):
    return p["a"] + p["b"] * u + u**3


def henon(u, p):
    return jnp.stack([p["a"] - u[0] ** 2 - p["b"] * u[1], u[0]])


def a(p):
    return p["a"]


def b(p):
    return p["b"]


AUTO_EQUATIONS = """
      SUBROUTINE FUNC(NDIM,U,ICP,PAR,IJAC,F,DFDU,DFDP)
      IMPLICIT NONE
      INTEGER, INTENT(IN) :: NDIM, ICP(*), IJAC
      DOUBLE PRECISION, INTENT(IN) :: U(NDIM), PAR(*)
      DOUBLE PRECISION, INTENT(OUT) :: F(NDIM)
      DOUBLE PRECISION, INTENT(INOUT) :: DFDU(NDIM,NDIM),DFDP(NDIM,*)
      F(1)=PAR(1)-U(1)+U(1)**3
      END SUBROUTINE FUNC
      SUBROUTINE STPNT(NDIM,U,PAR,T)
      IMPLICIT NONE
      INTEGER, INTENT(IN) :: NDIM
      DOUBLE PRECISION, INTENT(INOUT) :: U(NDIM),PAR(*)
      DOUBLE PRECISION, INTENT(IN) :: T
      PAR(1)=2.0D0
      U(1)=-1.5213797068045676D0
      END SUBROUTINE STPNT
      SUBROUTINE BCND
      END SUBROUTINE BCND
      SUBROUTINE ICND
      END SUBROUTINE ICND
      SUBROUTINE FOPT
      END SUBROUTINE FOPT
      SUBROUTINE PVLS
      END SUBROUTINE PVLS
"""
AUTO_CONSTANTS = """NDIM=1, IPS=1, IRS=0, ILP=1, ICP=[1], NTST=10, NCOL=4, IAD=3
ISP=2, ISW=1, IPLT=0, NBC=0, NINT=0, NMX=5000, NPR=5000, MXBF=0
IID=0, ITMX=8, ITNW=7, NWTN=3, JAC=0, EPSL=1e-10, EPSU=1e-10, EPSS=1e-10
DS=-0.001, DSMIN=1e-08, DSMAX=0.005, IADS=1, NPAR=1
RL0=-3.0, RL1=3.0
"""


def singles() -> None:
    """Print the milliseconds per point, including the location of special points."""
    equilibria = continuation.Equilibrium(cusp, {"a": 2.0, "b": -1.0})
    points = continuation.FixedPoint(henon, {"a": 0.0, "b": 0.5})
    one = continuation.branch(equilibria, [-1.5], a, (-3, 3), direction=-1)
    fixed = continuation.branch(points, [0.0, 0.0], a, (-1, 3), direction="both")
    fold, flip = one.of_kind("fold")[0], fixed.of_kind("flip")[0]
    box = ((-3.0, 3.0), (-2.0, 2.0))
    calls = {
        "equilibria of the cusp": lambda: continuation.branch(
            equilibria, [-1.5], a, (-3, 3), direction=-1
        ),
        "fixed points of Henon's map": lambda: continuation.branch(
            points, [0.0, 0.0], a, (-1, 3), direction="both"
        ),
        "curve of folds through the cusp": lambda: continuation.curve(
            fold, (a, b), box
        ),
        "curve of Henon's flips": lambda: continuation.curve(flip, (a, b), box),
    }
    work = {}
    for name, call in calls.items():
        begun = time.process_time()
        work[name] = len(call().points)
        print(f"  {name}: first run {time.process_time() - begun:.1f} s of CPU time")
    for row in _timing.compare(calls, work):
        points_run = work[row.name]
        print(f"  {row.name}: {1e3 / row.rate:.2f} ms a point ({points_run} points)")


def wall(system):
    return system.wall


def orbits() -> None:
    """Time orbits of the forced oscillator with one impact, multipliers included.

    The start is at half the phase of the closed form: with V the impact speed, (1 - r)
    V / (2 w) = |gamma| sin(phi), wall = |gamma| cos(phi) - k V.
    """
    w, r, phi = 2.8, 0.8, 0.5
    gamma = 1 / (1 - w * w)
    speed = abs(gamma) * np.sin(phi) * 2 * w / (1 - r)
    place = abs(gamma) * np.cos(phi) - (1 + r) / np.tan(np.pi / w) / 2 * speed
    system = ImpactOscillator(omega=w, restitution=r, wall=place)
    phase = np.mod((np.pi - phi) / (2 * np.pi), 1.0)
    problem = continuation.ImpactingOrbits(system, (0,), 1, 2, steps=16)
    start = continuation.Start(problem, np.array([phase, place, -r * speed]))
    bounds = (place - 0.2, place + 0.2)
    plain = continuation.BranchSettings(special=False, max_step=0.02)

    def walk():
        return continuation.branch(
            problem, start, wall, bounds, settings=plain, direction="both"
        )

    begun = time.process_time()
    count = len(walk().points)
    print(f"  one impact: first run {time.process_time() - begun:.1f} s of CPU time")
    for row in _timing.compare({"one impact": walk}, {"one impact": count}):
        print(f"  {row.name}: {1e3 / row.rate:.2f} ms a point ({count} points)")


def cascade() -> None:
    """Time a branch from one impact per period to complete chatter, once."""
    begun = time.perf_counter()
    system = ImpactOscillator(omega=2.0, wall=-0.04)
    found = continuation.branch(system, None, wall, (-1.2, 0.0), direction=-1)
    kinds = [point.kind for point in found.special]
    print(
        f"  {len(found.points)} points, {kinds.count('grazing')} grazings, {kinds[-2:]}"
    )
    print(f"  {time.perf_counter() - begun:.1f} s without imports")


def batches(lanes: int = 100) -> None:
    """Time a hundred branches in one program, and one after the other."""
    values = np.linspace(-2.0, -0.5, lanes)
    starts = []
    for value in values:
        roots = np.roots([1.0, 0.0, value, 2.0])
        starts.append([roots[np.argmin(np.abs(roots.imag))].real])
    plain = continuation.BranchSettings(special=False)
    problem = continuation.Equilibrium(cusp, {"a": 2.0, "b": -1.0})

    def together():
        return continuation.follow_batch(
            problem, starts, a, (-3, 3), parameters={"a": 2.0, "b": values},
            direction=-1, points=200,
        )  # fmt: skip

    def in_turn():
        for value, start in zip(values, starts, strict=True):
            other = continuation.Equilibrium(cusp, {"a": 2.0, "b": value})
            continuation.branch(other, start, a, (-3, 3), direction=-1, settings=plain)

    calls = {"one after the other": in_turn, "in one batch": together}
    for row in _timing.compare(calls, float(lanes), repeats=3):
        print(f"  {row.name}: {1e3 * row.seconds:.0f} ms, {row.ratio:.0f} times")


def auto() -> None:
    """Time the same cusp branch with AUTO-07p."""
    program = shutil.which("auto") or shutil.which("auto-07p")
    if program is None:
        print("  auto is not installed (Debian package auto-07p): not compared")
        return
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "cusp.f90").write_text(AUTO_EQUATIONS, "utf-8")
        (place / "c.cusp").write_text(AUTO_CONSTANTS, "utf-8")
        script = (
            "import time\n"
            "run('cusp')\n"
            "begun = time.time(); found = run('cusp'); spent = time.time() - begun\n"
            "print('RESULT', spent, len(found[0]))\n"
        )
        (place / "time.auto").write_text(script, "utf-8")
        done = subprocess.run(
            [program, "time.auto"],
            cwd=place,
            capture_output=True,
            text=True,
            env={**os.environ, "OMP_NUM_THREADS": "1"},
            check=False,
        )
    rows = [x.split() for x in done.stdout.splitlines() if x.startswith("RESULT")]
    if not rows:
        print(f"  {program} ran, but not through: {done.stderr.strip()[-200:]}")
        return
    seconds, count = float(rows[-1][1]), int(rows[-1][2])
    print(f"  AUTO-07p, cusp: {1e3 * seconds / count:.3f} ms a point ({count} points)")
    print("  (its start and its files on disk included)")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--cascade", action="store_true", help="only that branch")
    if parser.parse_args().cascade:
        cascade()
        return
    print(f"core {CORE}; one point after the other:")
    singles()
    print("periodic orbits with impacts:")
    orbits()
    print("a hundred branches:")
    batches()
    print("AUTO-07p:")
    auto()


if __name__ == "__main__":
    main()
