"""Free run of the axis, exact over each sample for the held input, with sticking: the simulator of SciPy's fits."""

import math

import numba


def advance(v, u, h, inertia, coulomb, viscous):
    """Displacement and velocity after `h` seconds under the force `u`."""
    moved = 0.0
    # At most: slide to a stop, start again, reach the end.
    for _ in range(3):
        if v == 0.0:
            if abs(u) <= coulomb:
                break
            s = math.copysign(1.0, u)
        else:
            s = math.copysign(1.0, v)
        force = u - s * coulomb
        rate = viscous / inertia
        if rate * h > 1e-9:
            final = force / viscous
            decay = math.exp(-rate * h)
            after = final + (v - final) * decay
            stops = after * s < 0.0
            part = math.log((v - final) / -final) / rate if stops else h
            moved += final * part + (v - final) * (1.0 - math.exp(-rate * part)) / rate
        else:
            acceleration = force / inertia
            after = v + acceleration * h
            stops = after * s < 0.0
            part = -v / acceleration if stops else h
            moved += (v + 0.5 * acceleration * part) * part
        v = 0.0 if stops else after
        h -= part
        if not stops or h <= 0.0:
            break
    return moved, v


def runner(translate):
    """The free run, each of its functions passed through `translate`."""
    step = translate(advance)

    def run(t, u, q, v, first, last, inertia, coulomb, viscous, offset, out):
        """Positions from sample `first` to one before `last`, from the state `q`, `v` there."""
        out[first] = q
        for k in range(first, last - 1):
            moved, v = step(v, u[k] - offset, t[k + 1] - t[k], inertia, coulomb, viscous)
            q += moved
            out[k + 1] = q

    return translate(run)


# In plain Python, and compiled by Numba.
RUNNERS = {"Python": runner(lambda function: function), "Numba": runner(numba.njit)}
