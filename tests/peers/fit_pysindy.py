"""PySINDy: dv/dt as a combination of v, sgn v and u, by differences of the smoothed velocity or in the weak form."""

import numpy as np
import pysindy
from axis import FILTER, Parameters, velocity

# Half-width of the weak form's windows, s, and as many as cover the recording four times over.
HALF_WIDTH = 0.1


def fit(case, weak, constant):
    """With a constant in the library, too, if asked for."""
    t, u, q = case.train()

    def estimate():
        v = velocity(t, q)
        functions = [lambda v, u: v, lambda v, u: np.sign(v), lambda v, u: u]
        names = [lambda v, u: "v", lambda v, u: "sgn(v)", lambda v, u: "u"]
        if constant:
            functions.append(lambda v, u: np.ones_like(np.asarray(v)))
            names.append(lambda v, u: "1")
        library = pysindy.CustomLibrary(functions, names)
        options = {}
        if weak:
            count = int(4 * (t[-1] - t[0]) / (2 * HALF_WIDTH))
            # Its windows are drawn from NumPy's global generator.
            np.random.seed(1)
            library = pysindy.WeakPDELibrary(
                library, spatiotemporal_grid=t, K=count, H_xt=[HALF_WIDTH], p=6, is_uniform=False
            )
        else:
            smoother = {"window_length": FILTER[0], "polyorder": FILTER[1]}
            options["differentiation_method"] = pysindy.SmoothedFiniteDifference(smoother_kws=smoother)
        # The terms are given, so nothing is to be thresholded away, and a ridge would only bias.
        optimizer = pysindy.STLSQ(threshold=0.0, alpha=0.0, normalize_columns=True)
        model = pysindy.SINDy(optimizer, library, **options)
        model.fit(v.reshape(-1, 1), t=t, u=u.reshape(-1, 1))
        return decode(model.coefficients()[0], case.gain), ""

    return estimate


def decode(coefficients, gain):
    v, sign, u, *constant = map(float, coefficients)
    inertia = gain / u
    return Parameters(inertia, -inertia * sign, -inertia * v, -inertia * constant[0] if constant else 0.0)
