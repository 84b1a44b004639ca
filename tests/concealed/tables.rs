//! The score.

use std::collections::BTreeMap;

use bristle::diagnose::Verdict;

use crate::answers::Answer;
use crate::labels::Kind;
use crate::plants::Noise;

/// Bounds of the bins of confidence.
const BINS: [f64; 8] = [0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 1.0];

/// Prints all tables.
pub fn print(answers: &[Answer]) {
    singles(answers);
    confusions(answers);
    clean(answers);
    pairs(answers);
    outside(answers);
    held_out(answers);
    reliability(answers);
}

fn of(answers: &[Answer], kind: Kind) -> Vec<&Answer> {
    answers.iter().filter(|a| a.label.kind() == kind).collect()
}

fn first(answer: &Answer) -> Option<&'static str> {
    answer.said.findings.first().map(|f| f.0)
}

fn right(answer: &Answer) -> bool {
    first(answer) == Some(answer.label.effects[0])
}

fn misnamed(answer: &Answer) -> bool {
    first(answer).is_some_and(|id| !answer.label.effects.contains(&id))
}

/// Wrong, with the right name listed as one that the data do not tell from it.
fn undecided(answer: &Answer) -> bool {
    misnamed(answer) && answer.said.open.contains(&answer.label.effects[0])
}

/// `12 of 13 (92.3 %)`.
fn share<'a>(of: &[&'a Answer], f: impl Fn(&'a Answer) -> bool) -> String {
    let count = of.iter().filter(|a| f(a)).count();
    let percent = 100.0 * count as f64 / of.len().max(1) as f64;
    format!("{count} of {} ({percent:.1} %)", of.len())
}

fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.retain(|v| v.is_finite());
    values.sort_by(f64::total_cmp);
    let at = (share * (values.len().max(1) - 1) as f64) as usize;
    values.get(at).copied().unwrap_or(f64::NAN)
}

fn singles(answers: &[Answer]) {
    let all = of(answers, Kind::Single);
    println!(
        "\nOne effect, named first; held-out error of 1 s free runs, median before and after:"
    );
    let mut effects: Vec<&str> = all.iter().map(|a| a.label.effects[0]).collect();
    effects.sort_unstable();
    effects.dedup();
    for effect in effects {
        print!("  {effect:<28}");
        let these: Vec<&Answer> = all
            .iter()
            .copied()
            .filter(|a| a.label.effects[0] == effect)
            .collect();
        for size in [0.03, 0.10, 0.30] {
            let sized: Vec<&Answer> = these
                .iter()
                .copied()
                .filter(|a| a.label.size == size)
                .collect();
            let count = sized.iter().filter(|a| right(a)).count();
            print!(
                "  {:>2.0} %: {count:>2} of {:>2}",
                100.0 * size,
                sized.len()
            );
        }
        let error = |k: usize| quantile(these.iter().map(|a| a.said.held_out[k]).collect(), 0.5);
        println!("   {:.4} -> {:.4}", error(0), error(1));
    }
    for (name, noisy) in [("low and medium noise", false), ("high noise", true)] {
        let these: Vec<&Answer> = all
            .iter()
            .copied()
            .filter(|a| (a.label.noise == Noise::High) == noisy)
            .collect();
        let sized = |least: f64, most: f64| -> Vec<&Answer> {
            these
                .iter()
                .copied()
                .filter(|a| (least..most).contains(&a.label.size))
                .collect()
        };
        println!(
            "  {name}: 10 % and more {}, 3 % {}; misnamed {}, {} of them beside the right name as a rival that the data do not tell apart",
            share(&sized(0.05, 1.0), right),
            share(&sized(0.0, 0.05), right),
            share(&these, misnamed),
            these.iter().filter(|a| undecided(a)).count()
        );
    }
}

fn confusions(answers: &[Answer]) {
    println!("\nWhat was said instead, of one effect:");
    let mut said: BTreeMap<(&str, String), usize> = BTreeMap::new();
    for answer in of(answers, Kind::Single).into_iter().filter(|a| !right(a)) {
        let name = first(answer).map_or_else(
            || format!("{:?}", answer.said.verdict).to_lowercase(),
            str::to_owned,
        );
        *said.entry((answer.label.effects[0], name)).or_default() += 1;
    }
    for ((effect, name), count) in said {
        println!("  {effect:<28} {name:<28} {count}");
    }
}

fn clean(answers: &[Answer]) {
    let these = of(answers, Kind::Clean);
    let adequate = |a: &Answer| a.said.verdict == Verdict::Adequate;
    println!("\nClean, called adequate: {}", share(&these, adequate));
    for answer in these.iter().filter(|a| !adequate(a)) {
        println!(
            "  seed {} {:?}: {:?} {:?}",
            answer.label.seed, answer.label.noise, answer.said.verdict, answer.said.findings
        );
    }
}

fn pairs(answers: &[Answer]) {
    let these = of(answers, Kind::Pair);
    let exact = |a: &Answer| {
        let mut said: Vec<&str> = a.said.findings.iter().map(|f| f.0).collect();
        let mut truth = a.label.effects.clone();
        said.sort_unstable();
        truth.sort_unstable();
        said == truth
    };
    println!(
        "\nTwo effects: both and no other {}; first name among them {}",
        share(&these, exact),
        share(&these, |a| first(a)
            .is_some_and(|id| a.label.effects.contains(&id)))
    );
    for answer in these.iter().filter(|a| !exact(a)) {
        let said: Vec<&str> = answer.said.findings.iter().map(|f| f.0).collect();
        println!(
            "  {:?} {:.2} {:?}: {:?} {said:?}",
            answer.label.effects, answer.label.size, answer.label.noise, answer.said.verdict
        );
    }
}

/// What the residual truly depends on, as the first word of a coordinate.
fn coordinates(effect: &str) -> &'static [&'static str] {
    match effect {
        "position-dependent-viscous" | "centrifugal" => &["position"],
        "fading-gain" => &["input", "time"],
        "jamming" => &["time"],
        _ => &[],
    }
}

fn outside(answers: &[Answer]) {
    println!(
        "\nOutside the catalogue: called unknown; of these with the right coordinate first; named:"
    );
    let all = of(answers, Kind::Outside);
    for (name, least, most) in [("10 % and more", 0.05, 1.0), ("3 %", 0.0, 0.05)] {
        let sized: Vec<&Answer> = all
            .iter()
            .copied()
            .filter(|a| (least..most).contains(&a.label.size))
            .collect();
        let unknown = |a: &Answer| a.said.verdict == Verdict::Unknown;
        let known: Vec<&Answer> = sized.iter().copied().filter(|a| unknown(a)).collect();
        let located = |a: &Answer| {
            let coordinate = a.said.coordinate.unwrap_or_default();
            coordinates(a.label.effects[0])
                .iter()
                .any(|c| coordinate.starts_with(c))
        };
        println!(
            "  {name}: {}; {}",
            share(&sized, unknown),
            share(&known, located)
        );
        let mut said: BTreeMap<(&str, String), usize> = BTreeMap::new();
        for answer in sized {
            let names: Vec<&str> = answer.said.findings.iter().map(|f| f.0).collect();
            let what = format!("{:?} {}", answer.said.verdict, names.join("+"));
            *said.entry((answer.label.effects[0], what)).or_default() += 1;
        }
        for ((effect, what), count) in said {
            println!("    {effect:<28} {what:<50} {count}");
        }
    }
}

fn held_out(answers: &[Answer]) {
    let ratio = |a: &Answer| a.true_model.map(|t| a.said.held_out[1] / t);
    for (name, kind) in [("one effect", Kind::Single), ("two effects", Kind::Pair)] {
        let ratios: Vec<f64> = of(answers, kind).into_iter().filter_map(ratio).collect();
        println!(
            "\nHeld-out error over that of the true structure, {name}: median {:.3}, 90 % quantile {:.3}",
            quantile(ratios.clone(), 0.5),
            quantile(ratios, 0.9)
        );
    }
}

fn reliability(answers: &[Answer]) {
    println!("\nFindings by confidence: how many, mean confidence, share of right names:");
    let findings: Vec<(f64, bool)> = answers
        .iter()
        .flat_map(|a| {
            a.said
                .findings
                .iter()
                .map(|(id, c)| (*c, a.label.effects.contains(id)))
        })
        .collect();
    for bin in BINS.windows(2) {
        let inside = |c: f64| c > bin[0] && c <= bin[1];
        let these: Vec<_> = findings.iter().filter(|f| inside(f.0)).collect();
        if these.is_empty() {
            continue;
        }
        let count = these.len() as f64;
        let mean = these.iter().map(|f| f.0).sum::<f64>() / count;
        let right = these.iter().filter(|f| f.1).count() as f64 / count;
        println!(
            "  {:.2} to {:.2}: {:>5}  {mean:.3}  {right:.3}",
            bin[0],
            bin[1],
            these.len()
        );
    }
}
