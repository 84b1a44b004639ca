"""mujoco.sysid: a body on a joint with damping and friction loss behind a motor, rolled out by MuJoCo.

Friction loss is a soft constraint in MuJoCo: below some speed it acts like a damper. Its time constant is set to two
steps, the shortest that the engine takes. Its strength goes by the inertia of the body without the armature of the joint,
so the inertia to find is the body's: with all of it in the armature, friction would have no effect.
"""

import contextlib
import io

import mujoco
import numpy as np
from axis import Parameters, velocity, windows
from mujoco import sysid

XML = """
<mujoco>
  <option timestep="{period!r}" gravity="0 0 0" integrator="implicitfast"><flag contact="disable"/></option>
  <worldbody><body name="load">
    <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
    <joint name="axis" type="{kind}" axis="0 0 1" damping="1" frictionloss="1" solreffriction="{constant!r} 1"/>
  </body></worldbody>
  <actuator><motor name="drive" joint="axis" gear="{gain!r}"/></actuator>
  <sensor><jointpos name="position" joint="axis"/></sensor>
</mujoco>
"""


def set_inertia(spec, parameter):
    """Mass of a slide, moment of inertia of a hinge: the other is of no consequence."""
    value = float(parameter.value[0])
    body = spec.body("load")
    body.mass = value
    body.inertia = [value] * 3


def set_friction(spec, parameter):
    spec.joint("axis").frictionloss = float(parameter.value[0])


def set_damping(spec, parameter):
    # The first coefficient of a polynomial in recent versions.
    spec.joint("axis").damping = [float(parameter.value[0]), 0.0, 0.0]


MODIFIERS = {"inertia": set_inertia, "frictionloss": set_friction, "damping": set_damping}


def fit(case, start, in_windows):
    t, u, q = case.train()
    period = float((t[-1] - t[0]) / (len(t) - 1))
    kind = "hinge" if case.motion == "rotary" else "slide"
    xml = XML.format(period=period, kind=kind, constant=2.0 * period, gain=float(case.gain))

    def difference(params, predicted, measured, model, return_pred_all, **state):
        """Of the positions after each step; the state that starts a run is given."""
        positions = np.asarray(state["state"])[:, 1:2]
        seen = sysid.TimeSeries(measured.times[1:], measured.data[1:], measured.signal_mapping)
        modelled = sysid.TimeSeries(seen.times, positions, measured.signal_mapping)
        return (positions - seen.data).ravel() / np.std(q), modelled, seen

    def estimate():
        spec = mujoco.MjSpec.from_string(xml)
        model = spec.compile()
        v = velocity(t, q)
        # Runs of one length can be stepped together; the last, shorter one is left out.
        pieces = windows(t)[:-1] if in_windows else [(0, len(t))]
        length = min(last - first for first, last in pieces)
        clock = period * np.arange(length)
        cut = lambda x, first: x[first : first + length].reshape(-1, 1)
        sequences = sysid.ModelSequences(
            "axis",
            spec,
            [f"from sample {first}" for first, _ in pieces],
            [sysid.create_initial_state(model, q[first : first + 1], v[first : first + 1]) for first, _ in pieces],
            [sysid.TimeSeries.from_control_names(clock, cut(u, first), model) for first, _ in pieces],
            [sysid.TimeSeries.from_names(clock, cut(q, first), model) for first, _ in pieces],
        )
        params = sysid.ParameterDict()
        for (name, modifier), value in zip(MODIFIERS.items(), start.vector()):
            params.add(sysid.Parameter(name, value, 0.02 * value, 50.0 * value, modifier=modifier))
        residual = sysid.build_residual_fn(
            models_sequences=[sequences], modify_residual=difference, resample_true=False
        )
        # The optimizer prints each step, whatever it is told.
        with contextlib.redirect_stdout(io.StringIO()):
            found, _ = sysid.optimize(params, residual, optimizer="mujoco", max_iters=100, verbose=False, x_scale="jac")
        return Parameters(*(float(found[name].value[0]) for name in MODIFIERS)), ""

    return estimate
