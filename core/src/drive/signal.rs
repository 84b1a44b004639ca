//! The signals that telemetry and recordings choose from.

use heapless::Vec;
use serde::{Deserialize, Serialize};

/// A signal of the control path. The order is that of the values in a frame and part of the protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[repr(u8)]
pub enum Signal {
    /// What drives the axis from this sample until the next, in the unit of `u`.
    Input,
    /// Measured position: a whole number of encoder counts.
    Position,
    /// Velocity of the observer, rad/s or m/s.
    Velocity,
    /// Motor current, A.
    Current,
    /// Bus voltage, V.
    Bus,
    /// Position error, rad or m; zero unless a position is asked for.
    Error,
    /// The friction that the control law compensates, N·m or N.
    Friction,
    /// The Coulomb level that the control law has learnt, N·m or N.
    Coulomb,
}

/// How many signals there are.
pub const SIGNALS: usize = 8;

impl Signal {
    /// All signals in their order.
    pub const ALL: [Self; SIGNALS] = [
        Self::Input,
        Self::Position,
        Self::Velocity,
        Self::Current,
        Self::Bus,
        Self::Error,
        Self::Friction,
        Self::Coulomb,
    ];
}

/// Which signals are wanted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Selection(u8);

impl Selection {
    /// These signals.
    pub const fn of(signals: &[Signal]) -> Self {
        let (mut bits, mut k) = (0, 0);
        while k < signals.len() {
            bits |= 1 << (signals[k] as u8);
            k += 1;
        }
        Self(bits)
    }

    /// Whether a signal is wanted.
    pub const fn contains(self, signal: Signal) -> bool {
        self.0 & 1 << (signal as u8) != 0
    }

    /// How many are wanted.
    pub const fn len(self) -> usize {
        self.0.count_ones() as usize
    }

    /// Whether none is.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The wanted signals in their order.
    pub fn iter(self) -> impl Iterator<Item = Signal> {
        Signal::ALL.into_iter().filter(move |s| self.contains(*s))
    }
}

/// All signals at one sample, as words: the position is an `i32`, the others are what
/// [`Number::to_word`](super::Number::to_word) makes of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Snapshot {
    /// The number of the control period, counted from 1.
    pub period: u32,
    /// In the order of [`Signal::ALL`].
    pub words: [u32; SIGNALS],
}

impl Snapshot {
    /// One of the values.
    #[inline]
    pub const fn get(&self, signal: Signal) -> u32 {
        self.words[signal as usize]
    }

    /// The wanted values, as a message carries them.
    pub fn chosen(&self, selection: Selection) -> Vec<u32, SIGNALS> {
        selection.iter().map(|s| self.get(s)).collect()
    }
}
