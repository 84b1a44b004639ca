//! Bristle on the host: recordings in, diagnosed and identified models out.
//!
//! Data goes one way, and a module uses only those before it in this order:
//! recordings and models → weak-form rows → identification → diagnosis → report → command line.
//! [`format`] prints numbers for all of them and uses none.

pub mod axis;
pub mod cli;
pub mod diagnose;
pub mod dictionary;
pub mod effects;
pub mod error;
pub mod fit;
pub mod format;
pub mod identify;
pub mod linear;
pub mod model;
pub mod noise;
pub mod problem;
pub mod recording;
pub mod report;
pub mod simulate;
pub mod system;
pub mod weak;
