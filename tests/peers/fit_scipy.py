"""Output error by scipy.optimize.least_squares: the parameters whose free run comes closest to the positions."""

import math

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
    run(t[:3], u[:3], 0.0, 0.0, 0, 3, 1.0, 1.0, 1.0, 0.0, np.empty(3))
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
            theta = (*map(float, theta), 0.0)[:4]
            for first, last in pieces:
                run(times, inputs, float(q[first]), float(v[first]), first, last, *theta, out)
            return np.asarray(out) - q

        return solve(residual, start.vector(case.offset))

    return estimate


def fit_ode(case, start):
    """Over runs of 1 s by scipy.integrate.solve_ivp, as one writes it who has no simulator."""
    t, u, q = case.train()
    force = (case.gain * u).tolist()
    # Speed at which the sign is 0.76: no adaptive step survives the jump itself.
    smooth = 1e-2 * float(np.std(velocity(t, q)))

    def estimate():
        v = velocity(t, q)
        period = float(t[-1] - t[0]) / (len(t) - 1)

        def residual(theta):
            inertia, coulomb, viscous, offset = (*map(float, theta), 0.0)[:4]

            def slope(time, x):
                drive = force[min(int((time - t[0]) / period + 1e-6), len(force) - 1)]
                speed = x[1]
                resistance = coulomb * math.tanh(speed / smooth) + viscous * speed + offset
                return speed, (drive - resistance) / inertia

            out = np.empty(len(t))
            for first, last in windows(t):
                # No step may pass over what the input does.
                solution = scipy.integrate.solve_ivp(
                    slope, (t[first], t[last - 1]), [q[first], v[first]], "LSODA", t[first:last],
                    rtol=1e-6, atol=1e-9, max_step=5.0 * period,
                )  # fmt: skip
                out[first:last] = solution.y[0]
            return out - q

        # Differences far above what the tolerances leave of a solution.
        return solve(residual, start.vector(case.offset), diff_step=1e-3)

    return estimate


def solve(residual, start, **options):
    scale = np.abs(start)
    # What is positive stays so; the offset may change its sign.
    low, high = 0.02 * scale, 50.0 * scale
    low[3:] = -high[3:]
    result = scipy.optimize.least_squares(residual, start, bounds=(low, high), x_scale=scale, max_nfev=100, **options)
    return Parameters(*map(float, result.x)), f"{result.nfev} steps"
