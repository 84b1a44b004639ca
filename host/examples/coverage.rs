//! Whether standard errors are true: simulated axes under every friction law, identified, and how often the truth lies
//! within 1.96 standard errors (95 % if it does). Where it does not, `bias/se` (the median error in standard errors) and
//! `scatter/se` (half of what lies between the 16th and the 84th percentile) tell why: 0 and 1 are true.
//!
//! ```text
//! cargo run --release --example coverage -- --runs 500 --seed 1
//! ```
//!
//! Each axis is drawn afresh and driven twice for 24 s: by a multisine of torque, and slowly by a position controller through
//! zero velocity, as Stribeck curves ask for. `--help` lists the options.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::io::Write as _;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use clap::builder::PossibleValuesParser;
use clap::{Parser, ValueEnum};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use bristle::bench::{self, Control, Sensors};
use bristle::excite::{Excitation, Shape};
use bristle::identify::{self, identify};
use bristle::model::Model;
use bristle::pem::{self, Optimiser};
use bristle::plant;
use bristle::recording::Recording;

const LAWS: [(&str, &[&str]); 6] = [
    ("coulomb-viscous", &[]),
    ("stribeck", &["static", "stribeck_velocity"]),
    ("static", &["static", "stribeck_velocity"]),
    ("dahl", &["bristle_stiffness"]),
    ("lugre", &BRISTLES),
    ("modified-lugre", &BRISTLES),
];
const BRISTLES: [&str; 4] = [
    "static",
    "stribeck_velocity",
    "bristle_stiffness",
    "bristle_damping",
];
const SECONDS: f64 = 24.0;
const RATE: f64 = 1000.0;

/// How often the truth lies within the standard errors, on simulated axes
#[derive(Parser)]
struct Options {
    /// One friction law instead of all
    #[arg(long, value_parser = PossibleValuesParser::new(LAWS.map(|(law, _)| law)))]
    law: Option<String>,
    /// Axes under each law
    #[arg(long, default_value_t = 100)]
    runs: u64,
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Leave out this many axes of the seed from the beginning
    #[arg(long, value_name = "RUNS", default_value_t = 0)]
    skip: u64,
    /// Counts of the encoder a turn
    #[arg(long, default_value_t = 16384.0)]
    counts: f64,
    /// RMS of the torque that is not recorded, as a share of the torque
    #[arg(long, value_name = "SHARE", default_value_t = 0.02)]
    noise: f64,
    #[arg(long, value_enum, default_value_t = Experiment::Both)]
    experiment: Experiment,
    #[arg(long, value_enum, default_value_t = Method::Dbi)]
    method: Method,
    /// Write every estimate to a CSV file
    #[arg(long, value_name = "FILE.csv")]
    dump: Option<PathBuf>,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Experiment {
    Both,
    Fast,
    Slow,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Method {
    Dbi,
    Pem,
}

/// One parameter of one axis.
#[derive(Clone, Copy)]
struct Estimate {
    truth: f64,
    value: f64,
    se: f64,
    /// Whether twins of the recordings took off its bias.
    unbiased: bool,
}

impl Estimate {
    fn relative(&self) -> f64 {
        (self.value - self.truth) / self.truth
    }

    fn in_errors(&self) -> f64 {
        (self.value - self.truth) / self.se
    }
}

/// What was found of an axis, by parameter.
type Estimates = BTreeMap<String, Estimate>;

fn main() -> std::io::Result<()> {
    let options = Options::parse();
    let first = options.seed * 1_000_000 + options.skip;
    let dump = options
        .dump
        .as_ref()
        .map(std::fs::File::create)
        .transpose()?;
    let mut dump = dump.map(std::io::BufWriter::new);
    if let Some(dump) = &mut dump {
        writeln!(dump, "law,seed,parameter,truth,value,se,unbiased")?;
    }
    println!(
        "law              parameter           runs  median  median |error|  bias/se  scatter/se  within 1.96 se"
    );
    for (law, extra) in LAWS {
        if options.law.as_ref().is_some_and(|only| only != law) {
            continue;
        }
        let all = run(law, extra, first..first + options.runs, &options);
        for name in ["inertia", "coulomb", "viscous"].iter().chain(extra) {
            let of: Vec<(u64, Estimate)> = (all.iter())
                .filter_map(|(seed, e)| Some((*seed, *e.get(*name)?)))
                .collect();
            if let Some(dump) = &mut dump {
                for (seed, e) in &of {
                    let Estimate {
                        truth,
                        value,
                        se,
                        unbiased,
                    } = e;
                    writeln!(
                        dump,
                        "{law},{seed},{name},{truth:e},{value:e},{se:e},{unbiased}"
                    )?;
                }
            }
            print_line(law, name, &of);
        }
    }
    dump.map_or(Ok(()), |mut dump| dump.flush())
}

fn print_line(law: &str, name: &str, of: &[(u64, Estimate)]) {
    let sorted = |f: &dyn Fn(&Estimate) -> f64| -> Vec<f64> {
        let mut values: Vec<f64> = of.iter().map(|(_, e)| f(e)).collect();
        values.sort_by(f64::total_cmp);
        values
    };
    let quantile =
        |values: &[f64], share: f64| values[(share * (values.len() - 1) as f64) as usize];
    if of.is_empty() {
        return println!("{law:16} {name:18}     0");
    }
    let z = sorted(&|e| e.in_errors());
    let within = z.iter().filter(|z| z.abs() < 1.96).count();
    println!(
        "{law:16} {name:18} {:5} {:+6.2} % {:12.2} % {:+9.2} {:10.2} {:12.1} %",
        of.len(),
        100.0 * quantile(&sorted(&|e| e.relative()), 0.5),
        100.0 * quantile(&sorted(&|e| e.relative().abs()), 0.5),
        quantile(&z, 0.5),
        0.5 * (quantile(&z, 0.8413) - quantile(&z, 0.1587)),
        100.0 * within as f64 / of.len() as f64
    );
}

fn run(
    law: &str,
    extra: &[&str],
    seeds: std::ops::Range<u64>,
    options: &Options,
) -> Vec<(u64, Estimates)> {
    let next = AtomicU64::new(seeds.start);
    let all = Mutex::new(Vec::new());
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                loop {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    if seed >= seeds.end {
                        break;
                    }
                    let errors = attempt(law, extra, seed, options);
                    match (errors, all.lock()) {
                        (Ok(errors), Ok(mut all)) => all.push((seed, errors)),
                        (Err(error), _) => eprintln!("{law}, seed {seed}: {error}"),
                        _ => {}
                    }
                }
            });
        }
    });
    all.into_inner().unwrap_or_default()
}

fn attempt(
    law: &str,
    extra: &[&str],
    seed: u64,
    options: &Options,
) -> bristle::error::Result<Estimates> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut log_between = |low: f64, high: f64| low * (high / low).powf(rng.random());
    let inertia = log_between(1e-3, 3e-2);
    let top_speed = log_between(3.0, 15.0);
    let hertz = log_between(0.8, 2.0);
    let torque = inertia * top_speed * TAU * hertz;
    let coulomb = torque * log_between(0.15, 0.6);
    let viscous = torque * log_between(0.05, 0.3) / top_speed;
    let stribeck_velocity = top_speed * log_between(0.02, 0.1);
    let stiffness = coulomb / log_between(1e-3, 5e-3);
    let truth: BTreeMap<&str, f64> = BTreeMap::from([
        ("inertia", inertia),
        ("coulomb", coulomb),
        ("viscous", viscous),
        ("static", coulomb * log_between(1.2, 1.8)),
        ("stribeck_velocity", stribeck_velocity),
        ("bristle_stiffness", stiffness),
        (
            "bristle_damping",
            (stiffness * inertia).sqrt() * log_between(0.2, 1.0),
        ),
    ]);
    let slow_hertz = log_between(0.2, 0.4);
    let slow_speed = stribeck_velocity * log_between(2.0, 5.0);
    let friction = |value: &dyn Fn(&str) -> String| -> String {
        let names = ["coulomb", "viscous"].iter().chain(extra);
        let lines: Vec<String> = names.map(|n| format!("{n} = {}", value(n))).collect();
        lines.join("\n")
    };
    let text = |value: &dyn Fn(&str) -> String| {
        format!(
            "[plant]\nmotion = \"rotary\"\ninertia = {}\n[friction]\nmodel = \"{law}\"\n{}",
            value("inertia"),
            friction(value)
        )
    };
    let parse = |text: String| Model::parse(&text).map_err(bristle::error::Error::Internal);
    let plant = parse(text(&|name| format!("{:e}", truth[name])))?;
    let asked = parse(text(&|_| "\"?\"".to_owned()))?;
    let sensors = |seed| Sensors {
        count: TAU / options.counts,
        load_noise: options.noise * torque,
        seed,
        ..Sensors::default()
    };
    let mut recordings = Vec::new();
    if options.experiment != Experiment::Slow {
        let signal = multisine(1.8 * torque, (0.1, hertz), seed);
        recordings.push(record(&plant, &signal, None, sensors(seed))?);
    }
    if options.experiment != Experiment::Fast {
        let amplitude = 1.5 * slow_speed / (TAU * slow_hertz);
        let signal = multisine(amplitude, (0.1, slow_hertz), seed + 1);
        let control = Control::of_bandwidth(6.0, 1.0 / inertia);
        recordings.push(record(&plant, &signal, Some(control), sensors(seed + 1))?);
    }
    let (bench, found) = identify(&recordings, &asked, identify::Options::default())?;
    let weak = found.model.to_toml();
    let mut model = bench.unbiased(found, &recordings)?.model;
    let unbiased = model.to_toml() != weak;
    if options.method == Method::Pem {
        let options = pem::Options {
            optimiser: Optimiser::LevenbergMarquardt,
            horizon: None,
            most: 1000,
        };
        let tracks = &bench.problem.tracks;
        model = pem::estimate(&recordings, tracks, &model, options, &|_| {})?.0;
    }
    let labels = model.labels();
    let parameters = labels.iter().zip(model.parameters());
    Ok(parameters
        .filter_map(|(label, p)| {
            let truth = truth.get(label.name)?;
            let found = Estimate {
                truth: *truth,
                value: p.value?,
                se: p.se?,
                unbiased,
            };
            Some((label.name.to_owned(), found))
        })
        .collect())
}

fn multisine(amplitude: f64, band: (f64, f64), seed: u64) -> Excitation {
    Excitation {
        shape: Shape::Multisine,
        amplitude,
        band,
        duration: SECONDS,
        seed,
    }
}

fn record(
    model: &Model,
    signal: &Excitation,
    control: Option<Control>,
    sensors: Sensors,
) -> bristle::error::Result<Recording> {
    let t: Vec<f64> = (0..(SECONDS * RATE) as usize)
        .map(|k| k as f64 / RATE)
        .collect();
    let values = signal.values(&t);
    let mut plant = plant::new(model)?;
    let record = bench::record(plant.as_mut(), t, &values, control, sensors);
    Ok(Recording {
        path: "simulated".into(),
        t: record.t,
        u: record.u,
        q: Some(record.q),
        ..Recording::default()
    })
}
