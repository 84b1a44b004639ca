//! The stages of a control period, for whoever measures what each costs.

/// What a control period goes through, in its order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Readings in their units, and the faults in them.
    Monitor,
    /// Position and velocity.
    Observer,
    /// The Coulomb level.
    Estimator,
    /// What depends on the position: gravity, cogging and their kind.
    Effects,
    /// Position and velocity loop.
    Controller,
    /// Friction taken away.
    Compensation,
    /// Torque and command within their limits.
    Limits,
    /// What the observer has to know of this period in the next.
    Memory,
    /// Voltage from current, where a current loop is part of the parameters.
    Current,
    /// Signals for recording and telemetry.
    Record,
}

impl Stage {
    /// All of them in their order.
    pub const ALL: [Self; 10] = [
        Self::Monitor,
        Self::Observer,
        Self::Estimator,
        Self::Effects,
        Self::Controller,
        Self::Compensation,
        Self::Limits,
        Self::Memory,
        Self::Current,
        Self::Record,
    ];
}

/// Is told when a stage has ended. A stage that is entered twice in a period ends twice.
pub trait Probe {
    /// This stage has ended just now.
    fn ended(&mut self, stage: Stage);
}

/// Nobody measures, and nothing is left of it in the code.
impl Probe for () {
    #[inline]
    fn ended(&mut self, _: Stage) {}
}
