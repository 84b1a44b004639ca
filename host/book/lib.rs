//! The book in `src`, which `tests/render.rs` renders.
