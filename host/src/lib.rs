//! Bristle on the host: recordings in, diagnosed and identified models out.
//!
//! Data goes one way. A module uses only those before it in this order, which `tests/structure.rs` checks:
//!
//! format → motion → error → image → effects → model → recording → weak → slack → phasor → problem → linear → noise → spectrum → projection → system → scan → normal → uncertainty → refine → dictionary → axis → step → simulate → plant → tune → excite → bench → servo → link → emulate → deploy → place → ports → guided → monitor → fit → identify → stream → pem → curve → check → diagnose → experiment → dbi → trials → showcase → cycle → report → flash → cli

pub mod axis;
pub mod bench;
pub mod check;
pub mod cli;
pub mod curve;
#[cfg(unix)]
pub mod cycle;
pub mod dbi;
#[cfg(unix)]
pub mod deploy;
pub mod diagnose;
pub mod dictionary;
pub mod effects;
#[cfg(unix)]
pub mod emulate;
pub mod error;
pub mod excite;
pub mod experiment;
pub mod fit;
pub mod flash;
pub mod format;
#[cfg(unix)]
pub mod guided;
pub mod identify;
pub mod image;
pub mod linear;
pub mod link;
pub mod model;
#[cfg(unix)]
pub mod monitor;
pub mod motion;
pub mod noise;
pub mod normal;
pub mod pem;
pub mod phasor;
#[cfg(unix)]
pub mod place;
pub mod plant;
pub mod ports;
pub mod problem;
pub mod projection;
pub mod recording;
pub mod refine;
pub mod report;
pub mod scan;
pub mod servo;
pub mod showcase;
pub mod simulate;
pub mod slack;
pub mod spectrum;
pub mod step;
pub mod stream;
pub mod system;
pub mod trials;
pub mod tune;
pub mod uncertainty;
pub mod weak;
