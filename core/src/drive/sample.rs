//! What the hardware gives each period, and how counts become positions.

use serde::{Deserialize, Serialize};

/// The raw readings of one control period, as the converters and the timer give them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sample {
    /// The encoder's counter, which wraps.
    pub count: u16,
    /// The current's converter, whose zero is the parameter `current_zero`.
    pub current: u16,
    /// The bus voltage's converter.
    pub bus: u16,
    /// Whether the gate driver pulls its fault line.
    pub gate_fault: bool,
}

/// Follows a counter that wraps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Encoder {
    last: Option<u16>,
    total: i32,
}

impl Encoder {
    /// An encoder at zero, wherever its counter stands.
    pub const fn new() -> Self {
        Self {
            last: None,
            total: 0,
        }
    }

    /// Takes the counter; returns by how much it moved since the last time, at most half of its range.
    #[inline]
    pub fn follow(&mut self, count: u16) -> i16 {
        let moved = self.last.map_or(0, |last| count.wrapping_sub(last) as i16);
        self.last = Some(count);
        self.total = self.total.wrapping_add(moved.into());
        moved
    }

    /// The counts since the start.
    #[inline]
    pub const fn total(&self) -> i32 {
        self.total
    }
}

#[cfg(test)]
mod tests {
    use super::Encoder;

    #[test]
    fn a_counter_is_followed_through_its_wrap_both_ways() {
        let mut encoder = Encoder::new();
        let counts = [65_530_u16, 65_535, 4, 20, 65_535, 65_000];
        let moved: std::vec::Vec<i16> = counts.iter().map(|&c| encoder.follow(c)).collect();
        assert_eq!(moved, [0, 5, 5, 16, -21, -535]);
        assert_eq!(encoder.total(), -530);
    }
}
