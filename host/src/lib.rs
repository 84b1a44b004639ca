//! Bristle on the host: recordings in, diagnosed and identified models out.
//!
//! Data goes one way: recording → weak-form rows → identify → diagnose → simulate → report. A module uses only
//! those before it in that order.

pub mod axis;
pub mod diagnose;
pub mod dictionary;
pub mod effects;
pub mod error;
pub mod fit;
pub mod identify;
pub mod linear;
pub mod model;
pub mod noise;
pub mod problem;
pub mod recording;
pub mod simulate;
pub mod system;
pub mod weak;
// pub mod cli;
