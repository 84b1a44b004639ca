"""Output error by scipy.optimize.least_squares: the parameters whose free run comes closest to the positions."""

import numpy as np
import scipy.integrate
import scipy.optimize
from axis import Parameters, velocity, windows
from stepping import RUNNERS


def fit(case, start, stepper, in_windows):
    """Over one free run from the first state, or over runs of 1 s from the measured states."""
    t, u, q = case.train()
    run = RUNNERS[stepper]
    # Numba compiles here, outside the time that counts.
    run(t[:3], u[:3], 0.0, 0.0, 0, 3, 1.0, 1.0, 1.0, np.empty(3))
    if stepper == "Python":
        # Plain numbers are faster than NumPy's in plain Python.
        times, inputs = t.tolist(), (case.gain * u).tolist()
    else:
        times, inputs = t, case.gain * u

    def estimate():
        v = velocity(t, q)
        pieces = windows(t) if in_windows else [(0, len(t))]
        out = np.empty(len(t)) if stepper == "Numba" else [0.0] * len(t)

        def residual(theta):
            for first, last in pieces:
                run(times, inputs, float(q[first]), float(v[first]), first, last, *map(float, theta), out)
            return np.asarray(out) - q

        return solve(residual, start)

    return estimate


def fit_ode(case, start):
    """The same free run by scipy.integrate.solve_ivp, as a first attempt would write it."""
    t, u, q = case.train()

    def estimate():
        v0 = velocity(t, q)[0]

        def residual(theta):
            inertia, coulomb, viscous = theta

            def slope(time, x):
                force = case.gain * u[min(np.searchsorted(t, time, "right"), len(t)) - 1]
                # A smooth sign: no adaptive step survives the jump.
                return [x[1], (force - coulomb * np.tanh(x[1] / 1e-3) - viscous * x[1]) / inertia]

            solution = scipy.integrate.solve_ivp(slope, (t[0], t[-1]), [q[0], v0], "LSODA", t, max_step=5e-3)
            return solution.y[0] - q

        return solve(residual, start)

    return estimate


def solve(residual, start):
    start = start.vector()
    bounds = (0.02 * start, 50.0 * start)
    result = scipy.optimize.least_squares(residual, start, bounds=bounds, x_scale=start, max_nfev=100)
    return Parameters(*map(float, result.x)), f"{result.nfev} steps"
