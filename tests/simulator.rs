//! The checks of the plant simulator that `validate.rs` judges the diagnosis with.

mod plants;

#[path = "plants/checks.rs"]
mod checks;
