//! What the sensors and the smoothing of velocity do to estimates.

use super::{Workbench, twin::Twin};
use crate::model::Model;
use crate::noise::Noise;
use crate::problem::Problem;
use crate::recording::Recording;
use crate::weak::Track;
use crate::{refine, system};

impl Workbench {
    /// Takes off what sensors and smoothing do.
    pub fn settle(&self, model: &mut Model, recordings: &[Recording]) {
        let number = |n: &str, d: usize| std::env::var(n).ok().and_then(|v| v.parse().ok()).unwrap_or(d);
        let (draws, rounds) = (number("DRAWS", 4), number("ROUNDS", 2));
        let trace = std::env::var("TRACE").is_ok();
        for round in 0..rounds {
            let Some((offset, spread, folds)) = self.offset(model, recordings, draws) else {
                eprintln!("no twin");
                return;
            };
            let residual = system::residual(&self.problem, model);
            let clean: Vec<f64> = residual.iter().zip(&offset).map(|(r, o)| r - o).collect();
            let chi = |x: &[f64]| self.noise.whiten(x).iter().zip(&folds).filter(|(_, f)| f.is_some()).map(|(z, _)| z * z).sum::<f64>();
            let unknowns = refine::free_parameters(model).len();
            let noise = if std::env::var("KEEP").is_ok() { self.noise.clone() } else { Noise::estimate(&self.problem, &clean, unknowns, &folds) };
            let before = model.clone();
            refine::refine_beside(&offset, &self.problem, model, &noise, &folds);
            if trace {
                let z: Vec<String> = before.parameters().iter().zip(model.parameters()).filter(|(_, p)| !p.known).map(|(b, p)| format!("{:.4}({:.4})", p.value.unwrap() / b.value.unwrap(), p.se.unwrap() / p.value.unwrap())).collect();
                eprintln!("round {round} rows {} of {} chi2 {:.1} clean {:.1} spread {:.1}: {}", folds.iter().flatten().count(), self.folds.iter().flatten().count(), chi(&residual), chi(&clean), chi(&spread), z.join(" "));
            }
        }
    }

    /// What sensors and smoothing add to the residual of every row, by twins.
    fn offset(&self, model: &Model, recordings: &[Recording], draws: usize) -> Option<(Vec<f64>, Vec<f64>, Vec<Option<usize>>)> {
        let before = &self.problem;
        let twins: Vec<Twin> = recordings
            .iter()
            .zip(&before.tracks)
            .map(|(r, t)| Twin::new(model, r, t))
            .collect::<Option<_>>()?;
        let mut sum = vec![0.0; before.rows.len()];
        let mut squares = vec![0.0; before.rows.len()];
        let mut count = vec![0.0; before.rows.len()];
        for draw in 0..draws {
            let at = (draw as f64 + 0.5) / draws as f64;
            let tracks = twins.iter().zip(recordings).zip(&before.tracks).enumerate().map(|(k, ((twin, r), t))| {
                let seen = twin.seen(r, t, at, (draw * 1000 + k) as u64);
                Track::smoothed(&seen, before.motion, self.balance, Some(t.smoothing))
                    .piece_of(t.whole, t.boundary)
            });
            let tracks = tracks.collect();
            let reaches: Vec<usize> = before.windows.iter().map(|w| w.reach).collect();
            let problem = Problem::new(tracks, &reaches, before.motion, before.response);
            let residual = system::residual(&problem, model);
            let mut rows = problem.rows.iter().zip(residual).peekable();
            for (k, row) in before.rows.iter().enumerate() {
                let key = |r: &crate::problem::Row| (r.track, r.centre);
                while rows.next_if(|(r, _)| key(r) < key(row)).is_some() {}
                if let Some((_, r)) = rows.next_if(|(r, _)| key(r) == key(row)) {
                    sum[k] += r;
                    squares[k] += r * r;
                    count[k] += 1.0;
                }
            }
        }
        let offset: Vec<f64> = sum.iter().zip(&count).map(|(s, c): (&f64, &f64)| if *c > 0.0 { s / c } else { 0.0 }).collect();
        let spread = squares.iter().zip(&offset).zip(&count).map(|((s, m), c)| if *c > 0.0 { (s / c - m * m).max(0.0).sqrt() } else { 0.0 }).collect();
        let folds = self.folds.iter().zip(&count).map(|(f, c)| f.filter(|_| *c > 0.0)).collect();
        Some((offset, spread, folds))
    }
}
