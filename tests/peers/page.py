"""The page of the book that shows the comparison."""

import importlib.metadata
import os
import platform
import subprocess

from axis import BRISTLE, ROOT

PAGE = ROOT / "host/book/src/peers.md"
PACKAGES = ("scipy", "pysindy", "mujoco", "numba", "numpy")

HEAD = """# Bristle and its peers

Written by `tests/peers/run`, which anyone can run: it needs Python and a package index, and puts its packages into
`target/peers`. Everything below is one run on one machine ({machine}; {versions}).

**The same for all.** The model is one inertia with Coulomb and viscous friction, `J·dv/dt = k·u − Fc·sgn v − Fv·v`, `k`
known; EMPS is fitted with the constant resistance of its published model, too. A method sees the first 70 % of a recording. Its parameters go into a Bristle model file, and `bristle simulate
--horizon 1` runs it over the last 30 %: *held-out nrmse* is the RMS error of the position change in windows of 1 s from the
measured state, over the RMS of the measured change. Simulated recordings last 30 s at 1 kHz, with a quantising encoder and
an unrecorded torque of 2 % of the drive (RMS).

**Time** is the wall time of the fit. Imports, reading the file and Numba's compilation do not count for the peers; for
Bristle the whole process counts, with reading, the choice of windows, standard errors and the judgement of the fit.

**What each peer was given.**
- *SciPy*: output error by `least_squares`, bounded and scaled, over one free run from the first state or over windows of 1 s from
  measured states. The simulator is exact for the held input and sticks; it is written in Python, or compiled by
  Numba. `solve_ivp` (LSODA, relative tolerance 1e-6, tanh for the sign) stands for a fit without a simulator of one's own; each
  takes a minute, so EMPS alone has it, over the windows, where it does best. *near* starts at the reference values themselves, *far*
  with J and Fv doubled and Fc halved.
- *mujoco.sysid*: inertia, frictionloss and damping of one body on a joint behind a motor (gear k), estimated by its own
  Gauss-Newton optimizer with parallel rollouts; time step equal to the sampling interval; the stiffest friction constraint
  that MuJoCo allows; same starts and bounds as SciPy.
- *PySINDy*: a library of v, sgn v and u, with and without a constant, no threshold; velocity from a Savitzky-Golay filter
  of 41 samples; weak form with windows of ±0.1 s. It needs no start values. A constant found is judged with it.
- *Bristle*: a file that says `"?"` for each parameter. It needs no start values and gives standard errors. With *1 s windows* it goes
  on to minimise what SciPy does (`--method pem --horizon 1`).

**Times beside Bristle's** weak form, over all tables (the whole program against a peer's bare fit):
{ratios}

Errors of parameters are relative to the reference: the true values of a simulated axis, the published ones of EMPS
(A. Janot, M. Gautier, M. Brunot, 2019), which belong to the model with the offset.
"""


# Kinds of peers, by what their names hold.
KINDS = {
    "SciPy with `solve_ivp`": ("solve_ivp",),
    "`mujoco.sysid`": ("mujoco",),
    "SciPy with a simulator written for this model, in plain Python": ("SciPy", "Python"),
    "the same compiled by Numba": ("SciPy", "Numba"),
    "PySINDy, weak form": ("PySINDy", "weak"),
    "PySINDy, smoothed differences (one linear regression)": ("PySINDy", "smoothed"),
}


def ratios(times):
    """From the least to the most that each kind of peer takes, of pairs of its name and its time over Bristle's."""
    lines = []
    for kind, parts in KINDS.items():
        own = [ratio for method, ratio in times if all(part in method for part in parts)]
        if own:
            lines.append(f"- {kind}: {min(own):.3g} to {max(own):.3g} times as long")
    return "\n".join(lines)


def machine():
    cores = os.cpu_count()
    return f"{cores} cores, {platform.machine()}, {platform.system()}"


def versions():
    own = subprocess.run([BRISTLE, "--version"], check=True, capture_output=True, text=True).stdout.strip()
    peers = [f"{name} {importlib.metadata.version(name)}" for name in PACKAGES]
    return ", ".join([own, f"Python {platform.python_version()}", *peers])


def percent(x):
    return f"{100 * x:+.1f} %" if abs(x) < 10 else f"×{1 + x:.0f}"


def duration(seconds):
    return f"{seconds:.3g} s" if seconds >= 1 else f"{1e3 * seconds:.3g} ms"


def table(case, rows, whole):
    fastest = rows[0].seconds
    names = ["J", "Fc", "Fv", "c"] if case.offset else ["J", "Fc", "Fv"]
    lines = [
        f"## {case.name}",
        "",
        f"| method | {' | '.join(names)} | held-out nrmse | time | × Bristle |",
        "| --- |" + " ---: |" * (len(names) + 3),
    ]
    truth = case.reference.vector(case.offset)
    for row in rows:
        errors = " | ".join(percent(e) for e in row.parameters.vector(case.offset) / truth - 1.0)
        steps = f" ({row.note})" if row.note else ""
        lines.append(
            f"| {row.method}{steps} | {errors} | {100 * row.nrmse:.2f} % | {duration(row.seconds)} | {row.seconds / fastest:.3g} |"
        )
    if whole is not None:
        errors = zip(names, whole.vector(case.offset) / truth - 1.0)
        found = ", ".join(f"{name} {percent(error)}" for name, error in errors)
        lines += ["", f"The publication fits the whole recording. So does `bristle identify --whole`: {found}."]
    return "\n".join(lines) + "\n"


def write(tables):
    times = [(row.method, row.seconds / rows[0].seconds) for _, rows, _ in tables for row in rows]
    text = HEAD.format(machine=machine(), versions=versions(), ratios=ratios(times))
    text += "".join("\n" + table(case, rows, whole) for case, rows, whole in tables)
    PAGE.write_text(text)
    return PAGE.relative_to(ROOT)
