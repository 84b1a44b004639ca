//! Sine and cosine along a coordinate of the motion.

use super::Point;

/// `carrier·sin(number·coordinate)` and `carrier·cos(number·coordinate)`.
pub struct Wave {
    /// Radians per unit of the coordinate.
    pub number: f64,
    /// What the wave runs along.
    pub coordinate: fn(&Point) -> f64,
    /// What it is multiplied by.
    pub carrier: fn(&Point) -> f64,
}

impl Wave {
    /// Sine and cosine times the carrier at a point.
    pub fn at(&self, at: &Point) -> (f64, f64) {
        let (sin, cos) = (self.number * (self.coordinate)(at)).sin_cos();
        let carrier = (self.carrier)(at);
        (carrier * sin, carrier * cos)
    }
}
