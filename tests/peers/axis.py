"""What all methods share: the model, its recordings, and how a set of parameters is judged.

The model is one inertia with Coulomb and viscous friction: J·dv/dt = k·u − Fc·sgn(v) − Fv·v, with k known; on one recording
with a constant resistance c besides.
"""

import dataclasses
import pathlib
import subprocess
import tempfile

import numpy as np
import scipy.signal

ROOT = pathlib.Path(__file__).resolve().parents[2]
BRISTLE = ROOT / "target/release/bristle"
# The first 70 % of a recording are for fitting, as in Bristle itself.
TRAIN_SHARE = 0.7
# Windows of free run, s.
HORIZON = 1.0
# Savitzky-Golay filter that gives peers the velocity which they ask for: 41 samples, cubic.
FILTER = (41, 3)


@dataclasses.dataclass(frozen=True)
class Parameters:
    """J, Fc, Fv, and a constant resistance where the model has one or a method finds one."""

    inertia: float
    coulomb: float
    viscous: float
    offset: float = 0.0

    def vector(self, offset=False):
        own = [self.inertia, self.coulomb, self.viscous]
        return np.array([*own, self.offset] if offset else own)


@dataclasses.dataclass(frozen=True)
class Case:
    """A recording of an axis, and what is known of it."""

    name: str
    path: pathlib.Path
    motion: str
    input: str
    gain: float
    # True values of a simulated axis; published ones of EMPS.
    reference: Parameters
    # Whether the model has a constant resistance.
    offset: bool = False

    def load(self):
        """t, u, q of the whole recording."""
        names = [name.split("[")[0] for name in self.path.open().readline().strip().split(",")]
        table = np.loadtxt(self.path, delimiter=",", skiprows=1)
        return tuple(table[:, names.index(name)] for name in ("t", "u", "q"))

    def train(self):
        t, u, q = self.load()
        last = int(TRAIN_SHARE * len(t))
        return t[:last], u[:last], q[:last]

    def model(self, parameters=None):
        """The model file; without parameters it asks for them."""
        value = lambda name: '"?"' if parameters is None else repr(float(getattr(parameters, name)))
        text = (
            f'[plant]\nmotion = "{self.motion}"\ninput = "{self.input}"\ngain = {self.gain!r}\n'
            f'inertia = {value("inertia")}\n[friction]\nmodel = "coulomb-viscous"\n'
            f'coulomb = {value("coulomb")}\nviscous = {value("viscous")}\n'
        )
        if self.offset or parameters is not None and parameters.offset:
            text += f"[effects.direction-asymmetry]\noffset = {value('offset')}\n"
        return text


def velocity(t, q):
    """Smoothed velocity."""
    period = (t[-1] - t[0]) / (len(t) - 1)
    return scipy.signal.savgol_filter(q, *FILTER, deriv=1, delta=period)


def windows(t):
    """First sample and one past the last of each window."""
    edges = [0]
    while edges[-1] < len(t):
        edges.append(int(np.searchsorted(t, t[edges[-1]] + HORIZON - 1e-9)))
    return list(zip(edges[:-1], edges[1:]))


def held_out_nrmse(case, parameters):
    """Error of 1 s free runs over the last 30 %, each run by `bristle simulate` from the measured state."""
    t, u, q = case.load()
    first = int(TRAIN_SHARE * len(t))
    t, u, q = t[first:], u[first:], q[first:]
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        (folder / "model.toml").write_text(case.model(parameters))
        np.savetxt(folder / "held.csv", np.column_stack([t, u, q]), "%.17g", ",", header="t,u,q", comments="")
        bristle(
            "simulate", "--model", folder / "model.toml", "--input", folder / "held.csv",
            "--out", folder / "predicted.csv", "--horizon", HORIZON,
        )  # fmt: skip
        predicted = np.loadtxt(folder / "predicted.csv", delimiter=",", skiprows=1)[:, 2]
    error = signal = 0.0
    for start, end in windows(t):
        change = q[start:end] - q[start]
        error += np.sum((predicted[start:end] - predicted[start] - change) ** 2)
        signal += np.sum(change**2)
    return float(np.sqrt(error / signal))


def bristle(*arguments):
    """Runs the program; its own message says what went wrong."""
    return subprocess.run([BRISTLE, *map(str, arguments)], check=True, capture_output=True, text=True).stdout
