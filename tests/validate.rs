//! Validation on freshly seeded plants: false alarms on clean axes and the confusion matrix of the effects.
//!
//! `cargo run --release --example validate -- --seed 1 --clean 200 --each 12` prints the rates; `--help` lists the options. The
//! plants of `tests/plants` share no code with the diagnosis: other formulation, other integrator, finer step.

mod plants;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use bristle::diagnose::{Verdict, diagnose};
use bristle::identify::{self, identify};
use bristle::model::Model;
use bristle::recording::Recording;
use clap::Parser;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use plants::{NAMED, Noise, OTHERS, Recipe, baseline_toml, keep, pair, simulate};

/// Diagnose freshly simulated plants and print how often the verdicts are right
#[derive(Parser)]
struct Options {
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Plants that are their baseline
    #[arg(long, value_name = "N", default_value_t = 200)]
    clean: u64,
    /// Plants with each effect of the catalogue
    #[arg(long, value_name = "N", default_value_t = 12)]
    each: u64,
    /// Plants with each effect outside the catalogue
    #[arg(long, value_name = "N", default_value_t = 6)]
    others: u64,
    /// Plants with two effects
    #[arg(long, value_name = "N", default_value_t = 0)]
    pairs: u64,
    /// Those whose first effect is this one, or "clean"
    #[arg(long, value_name = "EFFECT")]
    only: Option<String>,
    /// The one whose own seed is this
    #[arg(long, value_name = "SEED")]
    at: Option<u64>,
    /// Length of the recordings, s [default: drawn]
    #[arg(long)]
    seconds: Option<f64>,
    /// Sampling rate, Hz [default: drawn]
    #[arg(long)]
    rate: Option<f64>,
    /// Record differenced velocity in place of position
    #[arg(long)]
    velocity: bool,
    /// Keep each recording and its baseline
    #[arg(long, value_name = "FOLDER")]
    dump: Option<PathBuf>,
    /// Print a line for each plant
    #[arg(long)]
    verbose: bool,
}

/// One plant and what became of it.
struct Trial {
    seed: u64,
    truth: Vec<&'static str>,
    size: f64,
    noise: Noise,
    verdict: String,
    names: Vec<&'static str>,
    warned: Vec<&'static str>,
    line: String,
    /// Errors of inertia, Coulomb and viscous friction of the baseline, in standard errors.
    errors: Option<[f64; 3]>,
}

fn main() {
    let options = Options::parse();
    let recipes = recipes(&options);
    println!("{} plants", recipes.len());
    let trials = run(&recipes, &options);
    if options.verbose {
        trials.iter().for_each(|t| println!("{}", t.line));
    }
    clean_table(&trials);
    warnings_table(&trials);
    coverage_table(&trials);
    confusion_matrix(&trials);
    size_table(&trials);
    pairs_table(&trials);
}

fn recipes(options: &Options) -> Vec<Recipe> {
    let noises = [Noise::Low, Noise::Medium, Noise::High];
    let base = options.seed * 1_000_000;
    let mut recipes: Vec<Recipe> = (0..options.clean)
        .map(|k| Recipe::random(base + k, None, 0.0, noises[k as usize % 3]))
        .collect();
    let first = NAMED.iter().map(|e| (*e, options.each));
    for (e, (effect, count)) in first
        .chain(OTHERS.iter().map(|e| (*e, options.others)))
        .enumerate()
    {
        for k in 0..count {
            let size = [0.03, 0.10, 0.30][k as usize % 3];
            let noise = noises[(k / 3) as usize % 3];
            recipes.push(Recipe::random(
                base + 10_000 * (e as u64 + 1) + k,
                Some(effect),
                size,
                noise,
            ));
        }
    }
    for k in 0..options.pairs {
        let seed = base + 500_000 + k;
        let effects = pair(&mut ChaCha8Rng::seed_from_u64(seed));
        let size = [0.10, 0.30][k as usize % 2];
        let noise = noises[(k / 2) as usize % 3];
        recipes.push(Recipe::with_effects(seed, &effects, size, noise));
    }
    if let Some(at) = options.at {
        recipes.retain(|r| r.seed == at);
    }
    if let Some(only) = &options.only {
        recipes.retain(|r| r.effects.first().copied().unwrap_or("clean") == only);
    }
    for recipe in &mut recipes {
        recipe.duration = options.seconds.unwrap_or(recipe.duration);
        recipe.rate = options.rate.unwrap_or(recipe.rate);
    }
    recipes
}

fn run(recipes: &[Recipe], options: &Options) -> Vec<Trial> {
    let attempts = recipes.par_iter();
    attempts
        .filter_map(|recipe| attempt(recipe, options.velocity, options.dump.as_deref()))
        .collect()
}

/// Diagnoses one plant; `None` if the simulator could not give it sane motion and the size asked for.
fn attempt(recipe: &Recipe, velocity_only: bool, dump: Option<&Path>) -> Option<Trial> {
    let made = simulate(recipe)?;
    if !made.truth.met || made.truth.top_speed < 1e-3 {
        return None;
    }
    let baseline = baseline_toml(recipe, &made.truth);
    if let Some(folder) = dump {
        keep(folder, &made, &baseline);
    }
    let model = Model::parse(&baseline).expect("the baseline is a valid model");
    let (q, v) = if velocity_only {
        (None, Some(differenced(&made.t, &made.q)))
    } else {
        (Some(made.q), None)
    };
    let recording = [Recording {
        path: "plant.csv".into(),
        t: made.t,
        u: made.u,
        q,
        v,
        ..Recording::default()
    }];
    let (verdict, names, warned, more, errors) = match identify(
        &recording,
        &model,
        identify::Options::default(),
    )
    .and_then(|(bench, baseline)| {
        diagnose(&bench, &baseline, &recording, &|_| {}).map(|o| (bench, o))
    }) {
        Ok((bench, outcome)) => {
            let d = &outcome.diagnosis;
            let more = format!(
                "{:?} departure {:.2} confidence {:?} T {:.3} nrmse {:.3}->{:.3} J err {:+.3} left {:?} {:?}",
                bench.problem.response,
                d.departure,
                d.findings
                    .iter()
                    .map(|f| (f.confidence, f.evidence.delta_bic))
                    .collect::<Vec<_>>(),
                d.half_width[0],
                d.fit.before.held_out.nrmse,
                d.fit.after.held_out.nrmse,
                outcome.after.inertia.value.unwrap_or(0.0) / made.truth.inertia - 1.0,
                (
                    d.leftover.gain,
                    d.leftover.size,
                    d.leftover.coordinates.first().copied()
                ),
                bench.problem.rows.len(),
            );
            let error = |p: &bristle::model::Parameter, truth: f64| {
                (p.value.unwrap_or(f64::NAN) - truth) / p.se.unwrap_or(f64::NAN)
            };
            let before = &outcome.before;
            let errors = [
                error(&before.inertia, made.truth.inertia),
                error(&before.coulomb, made.truth.coulomb),
                error(&before.viscous, made.truth.viscous),
            ];
            let names = d.findings.iter().map(|f| f.id).collect();
            let warned = d.warnings.iter().map(|w| w.id).collect();
            (d.verdict, names, warned, more, Some(errors))
        }
        Err(error) => (
            Verdict::Unknown,
            vec!["error"],
            Vec::new(),
            error.to_string(),
            None,
        ),
    };
    let verdict = format!("{verdict:?}").to_lowercase();
    let line = format!(
        "{:?} seed {} size {} noise {:?} {:?} {:?} rate {} counts {} {} met {}: {verdict} {names:?} | {more}",
        recipe.effects,
        recipe.seed,
        recipe.size,
        recipe.noise,
        recipe.control,
        recipe.motion,
        recipe.rate,
        recipe.counts,
        made.truth.excitation,
        made.truth.met,
    );
    Some(Trial {
        seed: recipe.seed,
        truth: recipe.effects.clone(),
        size: recipe.size,
        noise: recipe.noise,
        verdict,
        names,
        warned,
        line,
        errors,
    })
}

/// Central differences of the encoder's counts: velocity as a log holds it, without a shift in time.
fn differenced(t: &[f64], q: &[f64]) -> Vec<f64> {
    let rate = |k: usize| {
        let (a, b) = (k.saturating_sub(1), (k + 1).min(q.len() - 1));
        (q[b] - q[a]) / (t[b] - t[a])
    };
    (0..q.len()).map(rate).collect()
}

fn clean_table(trials: &[Trial]) {
    println!("\nClean plants called adequate:");
    for noise in [Noise::Low, Noise::Medium, Noise::High] {
        let clean: Vec<&Trial> = trials
            .iter()
            .filter(|t| t.truth.is_empty() && t.noise == noise)
            .collect();
        let right = clean.iter().filter(|t| t.verdict == "adequate").count();
        println!("  noise {noise:?}: {right} of {}", clean.len());
    }
}

/// Warnings about recordings: those of clean plants are false, unless what they say is so.
fn warnings_table(trials: &[Trial]) {
    for (what, clean) in [("clean", true), ("all other", false)] {
        let these = trials.iter().filter(|t| t.truth.is_empty() == clean);
        let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
        for id in these.clone().flat_map(|t| &t.warned) {
            *counts.entry(id).or_default() += 1;
        }
        println!(
            "\nWarnings about {} {what} plants: {counts:?}",
            these.count()
        );
    }
}

/// How often the truth of a clean plant lies within so many standard errors of the estimate.
fn coverage_table(trials: &[Trial]) {
    println!(
        "\nTruth of clean plants within 2 and 3 standard errors (95.4 and 99.7 % if errors were normal):"
    );
    for (k, name) in ["inertia", "coulomb", "viscous"].iter().enumerate() {
        let clean = trials.iter().filter(|t| t.truth.is_empty());
        let errors: Vec<f64> = clean.filter_map(|t| t.errors).map(|e| e[k].abs()).collect();
        let within = |z: f64| {
            100.0 * errors.iter().filter(|e| **e <= z).count() as f64 / errors.len().max(1) as f64
        };
        println!("  {name:<8}{:>6.1} %{:>6.1} %", within(2.0), within(3.0));
    }
}

/// The confusion matrix: rows are what was simulated, columns what was named first.
fn confusion_matrix(trials: &[Trial]) {
    println!(
        "\nNamed first, of plants with one effect (columns in the order of the rows; then nothing: adequate, unknown):"
    );
    print!("{:<31}", "true effect");
    (1..=NAMED.len()).for_each(|k| print!("{k:>5}"));
    println!("{:>8}{:>8}", "adequ.", "unkn.");
    for (k, effect) in NAMED.iter().chain(&OTHERS).enumerate() {
        let these: Vec<&Trial> = trials.iter().filter(|t| t.truth == [*effect]).collect();
        if these.is_empty() {
            continue;
        }
        let number = if k < NAMED.len() {
            format!("{:>2} ", k + 1)
        } else {
            "   ".to_owned()
        };
        print!("{number}{effect:<28}");
        let count = |f: &dyn Fn(&Trial) -> bool| these.iter().filter(|t| f(t)).count();
        for name in NAMED {
            print!("{:>5}", count(&|t| t.names.first() == Some(&name)));
        }
        let unnamed = |verdict: &str| count(&|t| t.names.is_empty() && t.verdict == verdict);
        println!("{:>8}{:>8}", unnamed("adequate"), unnamed("unknown"));
    }
}

/// The same by the size of the effect, as a share of the RMS drive.
fn size_table(trials: &[Trial]) {
    println!(
        "\n{:<28}{:>6}{:>8}{:>8}{:>8}{:>8}  also named first",
        "true effect", "size", "plants", "right", "adequ.", "unkn."
    );
    for effect in NAMED.iter().chain(&OTHERS) {
        for size in [0.03, 0.10, 0.30] {
            let these: Vec<&Trial> = trials
                .iter()
                .filter(|t| t.truth == [*effect] && t.size == size)
                .collect();
            if these.is_empty() {
                continue;
            }
            let count = |f: &dyn Fn(&Trial) -> bool| these.iter().filter(|t| f(t)).count();
            let mut wrong: BTreeMap<&str, usize> = BTreeMap::new();
            for trial in &these {
                if let Some(first) = trial.names.first().filter(|n| *n != effect) {
                    *wrong.entry(first).or_default() += 1;
                }
            }
            println!(
                "{effect:<28}{size:>6.2}{:>8}{:>8}{:>8}{:>8}  {wrong:?}",
                these.len(),
                count(&|t| t.names.first() == Some(effect)),
                count(&|t| t.verdict == "adequate"),
                count(&|t| t.verdict == "unknown"),
            );
        }
    }
}

/// Axes with two effects: how often both are named and nothing else, and what was said otherwise.
fn pairs_table(trials: &[Trial]) {
    let pairs: Vec<&Trial> = trials.iter().filter(|t| t.truth.len() == 2).collect();
    if pairs.is_empty() {
        return;
    }
    let exact = |t: &Trial| t.names.len() == 2 && t.truth.iter().all(|e| t.names.contains(e));
    let (right, wrong): (Vec<&Trial>, Vec<&Trial>) = pairs.iter().partition(|t| exact(t));
    println!(
        "\nTwo effects, exactly these named: {} of {}; otherwise:",
        right.len(),
        pairs.len()
    );
    for t in wrong {
        println!(
            "  seed {}, {} at {:.2}, noise {:?}: {} {:?}",
            t.seed,
            t.truth.join(" + "),
            t.size,
            t.noise,
            t.verdict,
            t.names
        );
    }
}
