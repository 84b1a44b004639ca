"""Fits every recording with every method and writes the table of host/book/src/peers.md."""

import dataclasses
import json
import pathlib
import statistics
import subprocess
import tempfile
import time

import absl.logging
import fit_mujoco
import fit_pysindy
import fit_scipy
import page
import recordings
from axis import BRISTLE, Parameters, held_out_nrmse

# Start values off by a factor of two, in the directions that make the first run worst, and the reference itself.
FAR = (2.0, 0.5, 2.0)
# Fits faster than this are repeated; the median counts.
QUICK = 5.0
REPEATS = 5


@dataclasses.dataclass
class Row:
    method: str
    seconds: float
    parameters: Parameters
    nrmse: float
    note: str


def methods(case):
    """Name and fit of each peer; a fit returns parameters and a note."""
    near = case.reference
    far = Parameters(*(near.vector() * FAR), near.offset)
    for constant in (True,) if case.offset else (False, True):
        for weak in (False, True):
            name = "PySINDy, " + ("weak form" if weak else "smoothed differences") + (" and constant" if constant else "")
            yield name, fit_pysindy.fit(case, weak, constant)
    for in_windows in (False, True):
        over = "1 s windows" if in_windows else "free run"
        for start, where in ((near, "near"), (far, "far")):
            for stepper in ("Python", "Numba"):
                yield f"SciPy, {over}, {stepper}, {where}", fit_scipy.fit(case, start, stepper, in_windows)
            if case.path.stem == "emps_est" and in_windows:
                yield f"SciPy, {over}, solve_ivp, {where}", fit_scipy.fit_ode(case, start)
            # A joint of MuJoCo has no constant resistance.
            if not case.offset:
                yield f"mujoco.sysid, {over}, {where}", fit_mujoco.fit(case, start, in_windows)


def bristle(case, *options):
    """The whole process, reading included."""
    with tempfile.TemporaryDirectory() as folder:
        model, out = pathlib.Path(folder, "model.toml"), pathlib.Path(folder, "out.json")
        model.write_text(case.model())
        command = [BRISTLE, "identify", case.path, "--model", model, "--json", out, *options]

        def estimate():
            subprocess.run(command, check=True, capture_output=True)
            found = json.loads(out.read_text())["parameters"]
            names = ("inertia", "coulomb", "viscous", "direction-asymmetry.offset")
            return Parameters(*(found[name]["value"] for name in names if name in found)), ""

        return timed(estimate)


def timed(estimate):
    """Median wall time and what was found."""
    seconds = []
    while len(seconds) < REPEATS and sum(seconds) < QUICK:
        start = time.perf_counter()
        found = estimate()
        seconds.append(time.perf_counter() - start)
    return statistics.median(seconds), found


def row(case, method, outcome):
    seconds, (parameters, note) = outcome
    found = Row(method, seconds, parameters, held_out_nrmse(case, parameters), note)
    print(f"{case.name:22} {method:44} {seconds:9.3f} s  {found.nrmse:8.4f}  {parameters}", flush=True)
    return found


def main():
    # mujoco.sysid takes any start for one near a bound.
    absl.logging.set_verbosity(absl.logging.ERROR)
    tables = []
    with tempfile.TemporaryDirectory() as folder:
        for case in recordings.cases(pathlib.Path(folder)):
            rows = [row(case, "Bristle", bristle(case))]
            rows.append(row(case, "Bristle, 1 s windows", bristle(case, "--method", "pem", "--horizon", "1")))
            rows += [row(case, method, timed(estimate)) for method, estimate in methods(case)]
            # The publication fits all of the recording, and has the constant.
            whole = bristle(case, "--whole")[1][0] if case.offset else None
            tables.append((case, rows, whole))
    print(f"wrote {page.write(tables)}")


if __name__ == "__main__":
    main()
