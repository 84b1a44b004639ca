//! What was found before: a search comes by the same model again whenever something that it selected is refuted later.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use super::Found;
use crate::error::Result;
use crate::model::{Model, Parameter, Term};

/// The best that terms did on models, of one set of rows with one noise.
#[derive(Default)]
pub struct Memo(Mutex<HashMap<Key, Option<Found>>>);

/// A model with one more term, and whether that was sought closely in any case.
type Key = (Parts, bool);

/// What tells one model with one more term from another: for each parameter its effect and its name, its value and whether that
/// is given.
type Parts = Vec<(Option<(&'static str, &'static str)>, Option<u64>, bool)>;

impl Memo {
    /// What was found for a term on a model, or what a search finds now.
    pub(super) fn recall(
        &self,
        model: &Model,
        term: &Term,
        closely: bool,
        search: impl FnOnce() -> Result<Option<Found>>,
    ) -> Result<Option<Found>> {
        let key = (key(model, term), closely);
        let all = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = all().get(&key) {
            return Ok(found.clone());
        }
        let found = search()?;
        all().insert(key, found.clone());
        Ok(found)
    }
}

fn key(model: &Model, term: &Term) -> Parts {
    let part = |name, p: &Parameter| (name, p.value.map(f64::to_bits), p.known);
    let own = [&model.inertia, &model.gain, &model.coulomb, &model.viscous];
    let own = own.into_iter().map(|p| part(None, p));
    let terms = model.terms.iter().chain([term]);
    own.chain(terms.flat_map(|t| {
        let names = t.effect.parameters().iter().map(|spec| spec.name);
        (names.zip(&t.parameters)).map(move |(name, p)| part(Some((t.effect.id(), name)), p))
    }))
    .collect()
}
