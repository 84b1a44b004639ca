//! The faults: one numbered table, which the firmware raises and `bristle explain` shows.

use serde::{Deserialize, Serialize};

/// A reason to put the bridge in its safe state. The numbers are stable and never reused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[repr(u8)]
pub enum Fault {
    /// No set point for longer than `limits.command_timeout`.
    StaleCommand = 1,
    /// The position stands still under an input that must move the axis.
    EncoderLoss = 2,
    /// The position moved further in one period than the axis can.
    EncoderJump = 3,
    /// The motor current beyond `limits.current`, or beyond the bound of a run.
    Overcurrent = 4,
    /// The bus voltage below `limits.bus_min`.
    Undervoltage = 5,
    /// The bus voltage above `limits.bus_max`.
    Overvoltage = 6,
    /// The gate driver pulls its fault line.
    GateDriver = 7,
    /// No frame from the host for longer than `limits.link_timeout`.
    LinkLoss = 8,
    /// A control period was missed.
    Overrun = 9,
    /// The parameters in flash or in use are damaged.
    CorruptParameters = 10,
    /// A number in the control path is not finite, or a fixed-point one saturated.
    Unsound = 11,
    /// The watchdog has reset the processor.
    Watchdog = 12,
    /// The crystal has stopped.
    Clock = 13,
    /// The axis has left the travel of a run within bounds.
    Travel = 14,
    /// The axis is faster than a run within bounds may be.
    Overspeed = 15,
}

/// What the host says about a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Page {
    /// The stable name, as `bristle explain` takes it.
    pub id: &'static str,
    /// How the board finds out.
    pub detection: &'static str,
    /// Periods from the first bad sample until the bridge is off, in words.
    pub reaction: &'static str,
    /// What usually causes it and what to do.
    pub remedy: &'static str,
}

impl Fault {
    /// All faults in the order of their numbers.
    pub const ALL: [Self; 15] = [
        Self::StaleCommand,
        Self::EncoderLoss,
        Self::EncoderJump,
        Self::Overcurrent,
        Self::Undervoltage,
        Self::Overvoltage,
        Self::GateDriver,
        Self::LinkLoss,
        Self::Overrun,
        Self::CorruptParameters,
        Self::Unsound,
        Self::Watchdog,
        Self::Clock,
        Self::Travel,
        Self::Overspeed,
    ];

    /// The number that messages and logs carry.
    pub const fn number(self) -> u8 {
        self as u8
    }

    /// Its documentation.
    pub const fn page(self) -> &'static Page {
        &PAGES[self as usize - 1]
    }
}

const SAME_PERIOD: &str = "the period of the bad sample itself.";

const PAGES: [Page; 15] = [
    Page {
        id: "stale-command",
        detection: "no set point has come for `limits.command_timeout` periods while the axis runs",
        reaction: "the period in which the age passes `limits.command_timeout`",
        remedy: "Send set points more often than that, or raise `limits.command_timeout`; 0 turns the check off.",
    },
    Page {
        id: "encoder-loss",
        detection: "the count has not changed for `limits.stall_periods` periods, in each of which the input was beyond `limits.stall`",
        reaction: "the last of those periods",
        remedy: "Check the encoder's cable and supply. An axis held by a stop looks the same: raise `limits.stall` above what the stop must bear.",
    },
    Page {
        id: "encoder-jump",
        detection: "the count moved by more than `limits.jump` in one period",
        reaction: SAME_PERIOD,
        remedy: "Check shield and connector of the encoder; `limits.jump` must exceed the counts of one period at the highest speed.",
    },
    Page {
        id: "overcurrent",
        detection: "the measured current was beyond `limits.current` or the bound of a run that `bristle record` has begun, or the break input of the timer has turned the bridge off",
        reaction: SAME_PERIOD,
        remedy: "In a run of `bristle record`, ask for less amplitude or raise `--current`. Else look for a short circuit and a blocked axis, and lower `control.command_limit` or raise `limits.current`; all within the ratings of bridge and motor.",
    },
    Page {
        id: "undervoltage",
        detection: "the bus voltage was below `limits.bus_min` while the axis runs",
        reaction: SAME_PERIOD,
        remedy: "Check the supply and its current limit.",
    },
    Page {
        id: "overvoltage",
        detection: "the bus voltage was above `limits.bus_max`",
        reaction: SAME_PERIOD,
        remedy: "A braking axis feeds the bus: fit a brake resistor or brake more softly.",
    },
    Page {
        id: "gate-driver",
        detection: "the gate driver reports a fault on its line",
        reaction: SAME_PERIOD,
        remedy: "Overtemperature, overcurrent of a transistor or a low gate supply; the driver's status registers tell which.",
    },
    Page {
        id: "link-loss",
        detection: "no valid frame from the host for `limits.link_timeout` periods while the axis runs",
        reaction: "the period in which the silence passes `limits.link_timeout`",
        remedy: "Check the cable; a host that has nothing to say must send a `Hello` now and then. 0 turns the check off.",
    },
    Page {
        id: "overrun",
        detection: "a sample came before the step of the one before it was done, while the axis runs",
        reaction: "the period after the missed one",
        remedy: "The control step takes longer than a period: lower the rate, and report it, as the budget of the step is tested.",
    },
    Page {
        id: "corrupt-parameters",
        detection: "neither of the two records in flash has a right checksum, or the copy that the control law uses differs from the set in force",
        reaction: "at most 64 periods, as one period in 64 compares them",
        remedy: "Write and store the parameters again. When it comes back the memory is failing.",
    },
    Page {
        id: "unsound",
        detection: "the state or the output of the control law is not finite, or at the end of the fixed-point range",
        reaction: SAME_PERIOD,
        remedy: "The gains make the loop unstable, or the units leave no room: check the parameters against the model.",
    },
    Page {
        id: "watchdog",
        detection: "the processor was reset because the control task did not run for 20 ms",
        reaction: "the bridge is off from the reset on",
        remedy: "A defect of the firmware: report it with the log.",
    },
    Page {
        id: "clock",
        detection: "the clock security system found that the crystal has stopped",
        reaction: "at once, by interrupt",
        remedy: "Check the crystal. The board runs on from its internal oscillator with the bridge off until it is reset.",
    },
    Page {
        id: "travel",
        detection: "the position was further from where `bristle record` turned the axis on than the bound that it set for this run",
        reaction: SAME_PERIOD,
        remedy: "Begin in the middle of the axis' range, lower --amplitude, or raise --travel as far as there is room: with the bridge off the axis coasts on.",
    },
    Page {
        id: "overspeed",
        detection: "the velocity of the observer was beyond the bound that `bristle record` set for this run",
        reaction: "the period in which the observer shows it; it follows the axis within about one over `control.observer_bandwidth`",
        remedy: "Lower --amplitude, or raise --speed within what the axis bears.",
    },
];

/// A set of faults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Faults(u16);

impl Faults {
    /// No fault.
    pub const NONE: Self = Self(0);

    /// Adds a fault.
    pub fn raise(&mut self, fault: Fault) {
        self.0 |= 1 << (fault as u8);
    }

    /// Adds a fault if it is `present`.
    pub fn raise_if(&mut self, fault: Fault, present: bool) {
        self.0 |= u16::from(present) << (fault as u8);
    }

    /// Whether there is none.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Whether a fault is in the set.
    pub const fn contains(self, fault: Fault) -> bool {
        self.0 & 1 << (fault as u8) != 0
    }

    /// The faults of both sets.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// The faults in it, by number.
    pub fn iter(self) -> impl Iterator<Item = Fault> {
        Fault::ALL.into_iter().filter(move |f| self.contains(*f))
    }
}

#[cfg(test)]
mod tests {
    use super::{Fault, Faults};

    #[test]
    fn numbers_count_from_one_and_ids_differ() {
        for (k, fault) in Fault::ALL.into_iter().enumerate() {
            assert_eq!(usize::from(fault.number()), k + 1);
            let twins = Fault::ALL.iter().filter(|f| f.page().id == fault.page().id);
            assert_eq!(twins.count(), 1, "{fault:?}");
        }
    }

    #[test]
    fn a_set_holds_what_was_raised() {
        let mut set = Faults::NONE;
        set.raise(Fault::Clock);
        set.raise_if(Fault::StaleCommand, true);
        set.raise_if(Fault::Overrun, false);
        assert!(set.iter().eq([Fault::StaleCommand, Fault::Clock]));
    }
}
