//! The weak form: differential equations turned into algebraic rows without differentiating noise.
//!
//! Multiply `J·q̈ = k·u − F` by a test function φ that vanishes with its first derivatives at the ends of its
//! window, and integrate by parts: `J·∫q φ̈ = k·∫u φ − ∫F φ`. Each window gives one row.
//!
//! - [`TestFunction`]: φ, its derivatives and its integral.
//! - [`Kernel`]: φ sampled into weights, so that a functional is a dot product with the samples of a window.
//! - [`LeastSquares`]: rows accumulated into a triangular factor; memory does not grow with the recording.

mod kernel;
mod least_squares;
mod test_function;

pub use kernel::Kernel;
pub use least_squares::{LeastSquares, Singular};
pub use test_function::TestFunction;
