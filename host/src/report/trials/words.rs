//! What an experiment is called and measured in.

use crate::trials::Experiment;

/// Where adaptation is all that differs.
const SAME: &str = "Without: the same controller, gains and observer, with no torque against friction and nothing learned. Both have the same integral action, acceleration feed-forward, encoder, disturbance and limits.";

/// What an experiment is called and measured in.
pub(super) struct Words {
    pub title: &'static str,
    pub what: &'static str,
    /// What the controller does without adaptation, and what both have in common.
    pub without: &'static str,
    /// What is tracked, its unit, and those of command and friction level.
    pub tracked: &'static str,
    pub si: &'static str,
    pub command: &'static str,
    pub level: &'static str,
}

pub(super) fn words(experiment: Experiment) -> Words {
    match experiment {
        Experiment::Srv02 => Words {
            title: "Angular position of the SRV02 with on-line Coulomb estimation",
            what: "A geared servo from the public data of the Quanser SRV02, each with a load, a viscous coefficient and a friction level of its own around 30 % of rated torque. Friction changes twice. A slow sine, then a slow triangle, a step, and a move back to a standstill.",
            without: SAME,
            tracked: "position",
            si: "rad",
            command: "V",
            level: "N*m",
        },
        Experiment::DcMotor => Words {
            title: "Angular velocity of a DC motor with Dahl friction, adapted by DBI off-line",
            what: "A motor under voltage whose friction, around 30 % of rated torque, acts through bristles of known stiffness. Friction changes with the second of three stretches of a slow sine and a slow triangle in velocity; DBI sees the second stretch, and the third is judged.",
            without: SAME,
            tracked: "velocity",
            si: "rad/s",
            command: "V",
            level: "N*m",
        },
        Experiment::MassSpring => Words {
            title: "A mass on a spring with friction, tuned by its own identification",
            what: "A controller that starts from catalogue values. DBI sees each stretch, and where its status allows, both the friction model and the gains are computed anew. Mass, spring and friction change after the second stretch; the last stretch is judged.",
            without: "Without: the controller as it starts, with gains for the catalogue's mass, no spring and no friction. Tuned again, friction left alone: with the gains and the spring of its own identification, and no torque against friction. All have the same integral action, encoder, disturbance and limits.",
            tracked: "position",
            si: "m",
            command: "N",
            level: "N",
        },
    }
}
