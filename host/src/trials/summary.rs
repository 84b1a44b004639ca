//! What a campaign shows, over all of its plants.

use serde::Serialize;

use super::{Campaign, Merit, Way};

/// Middle and ends of a figure over the plants.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// The plant that half of the others are below.
    pub median: f64,
    /// The smallest.
    pub least: f64,
    /// The largest.
    pub most: f64,
}

/// What one way achieved over all plants.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Which way.
    pub way: Way,
    /// RMS tracking error.
    pub rms: Spread,
    /// Peak tracking error.
    pub peak: Spread,
    /// RMS error without the way over that with it, plant by plant; 1 for the controller alone.
    pub gain: Spread,
    /// The same throughout, changes and all.
    pub gain_throughout: Spread,
    /// RMS of the command.
    pub effort: Spread,
    /// Rise and settling of a step, s.
    pub rise: Option<Spread>,
    /// Settling of a step, s.
    pub settling: Option<Spread>,
    /// Error at standstill, counts.
    pub standstill: Option<Spread>,
    /// Plants that hunt.
    pub hunting: Option<usize>,
    /// Time to convergence over the plants that converge, s.
    pub convergence: Option<Spread>,
    /// Plants that converge within two seconds.
    pub in_time: Option<usize>,
}

/// Whether a claim holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// It does.
    Reached,
    /// It does not.
    Missed,
}

/// A claim about a way, and what the plants say.
#[derive(Clone, Debug, Serialize)]
pub struct Claim {
    /// Which way.
    pub way: Way,
    /// What is claimed.
    pub claim: &'static str,
    /// What was found.
    pub found: String,
    /// Whether it holds.
    pub verdict: Verdict,
}

/// What the error is to be divided by.
const GAIN: f64 = 5.0;
/// Time to converge, s.
const IN_TIME: f64 = 2.0;
/// Encoder counts at standstill, and of motion in its last second.
const COUNT: f64 = 1.0;
/// A loss in response time smaller than a sample or a hundredth is none.
const NO_LOSS: f64 = 1.01;

impl Spread {
    /// Over some numbers; none of none.
    pub fn of(numbers: impl Iterator<Item = f64>) -> Option<Self> {
        let mut all: Vec<f64> = numbers.collect();
        all.sort_by(f64::total_cmp);
        let (least, most) = (*all.first()?, *all.last()?);
        let middle = all.len() / 2;
        let median = if all.len() % 2 == 1 {
            all[middle]
        } else {
            0.5 * (all[middle - 1] + all[middle])
        };
        Some(Self {
            median,
            least,
            most,
        })
    }
}

impl Campaign {
    /// The ways that were tried, the controller alone first.
    pub fn ways(&self) -> Vec<Way> {
        self.trials
            .first()
            .map_or_else(Vec::new, |t| t.merits.iter().map(|m| m.way).collect())
    }

    fn each(&self, way: Way) -> impl Iterator<Item = (&Merit, &Merit)> + Clone {
        self.trials.iter().filter_map(move |trial| {
            let alone = trial.merits.first()?;
            Some((alone, trial.merits.iter().find(|m| m.way == way)?))
        })
    }

    /// What a way achieved over all plants.
    pub fn summary(&self, way: Way) -> Option<Summary> {
        let over = |f: &dyn Fn(&Merit, &Merit) -> Option<f64>| {
            Spread::of(self.each(way).filter_map(|(a, m)| f(a, m)))
        };
        let learned = matches!(way, Way::Observer | Way::Rows);
        let travel = self.each(way).filter_map(|(_, m)| m.travel);
        Some(Summary {
            way,
            rms: over(&|_, m| Some(m.rms))?,
            peak: over(&|_, m| Some(m.peak))?,
            gain: over(&|a, m| Some(a.rms / m.rms))?,
            gain_throughout: over(&|a, m| Some(a.rms_throughout / m.rms_throughout))?,
            effort: over(&|_, m| Some(m.effort))?,
            rise: over(&|_, m| Some(m.step?.rise)),
            settling: over(&|_, m| Some(m.step?.settling)),
            standstill: over(&|_, m| m.standstill),
            hunting: (travel.clone().count() > 0).then(|| travel.filter(|t| *t > COUNT).count()),
            convergence: over(&|_, m| m.convergence),
            in_time: learned.then(|| {
                self.each(way)
                    .filter(|(_, m)| m.convergence.is_some_and(|c| c <= IN_TIME))
                    .count()
            }),
        })
    }

    /// What was to be reached, and whether every adapted way does.
    pub fn claims(&self) -> Vec<Claim> {
        let adapted = self
            .ways()
            .into_iter()
            .skip(1)
            .filter(|way| !matches!(way, Way::OffLine | Way::Tuned));
        adapted
            .filter_map(|way| Some(self.claims_of(way, &self.summary(way)?)))
            .flatten()
            .collect()
    }

    fn claims_of(&self, way: Way, summary: &Summary) -> Vec<Claim> {
        let plants = self.trials.len();
        let mut claims = Vec::new();
        let mut add = |claim, found: String, holds: bool| {
            let verdict = if holds {
                Verdict::Reached
            } else {
                Verdict::Missed
            };
            claims.push(Claim {
                way,
                claim,
                found,
                verdict,
            });
        };
        add(
            "RMS tracking error at most a fifth of that without, median over plants",
            format!(
                "a factor of {:.1}, from {:.1} to {:.1}",
                summary.gain.median, summary.gain.least, summary.gain.most
            ),
            summary.gain.median >= GAIN,
        );
        let worse = self
            .each(way)
            .filter(|(a, m)| m.rms > a.rms || m.rms_throughout > a.rms_throughout)
            .count();
        add(
            "No plant worse with than without, changes of friction included",
            format!("{worse} of {plants} worse"),
            worse == 0,
        );
        if let Some(in_time) = summary.in_time {
            add(
                "Converged within 2 s of every change",
                format!(
                    "{in_time} of {plants} plants; median {}",
                    summary.convergence.map_or_else(
                        || "none".to_owned(),
                        |c| format!("{:.2} s, at most {:.2} s", c.median, c.most)
                    )
                ),
                in_time == plants,
            );
        }
        if let (Some(standstill), Some(hunting)) = (summary.standstill, summary.hunting) {
            add(
                "Standstill within one encoder count, without hunting",
                format!(
                    "at most {:.0} counts, {hunting} of {plants} hunt",
                    standstill.most
                ),
                standstill.most <= COUNT && hunting == 0,
            );
        }
        if let Some(found) = self.response(way) {
            let (rise, settling) = found;
            add(
                "No loss in response time (the source's claim): rise and settling of a step, median over plants",
                format!("rise {rise:.2} and settling {settling:.2} times that without"),
                rise <= NO_LOSS && settling <= NO_LOSS,
            );
        }
        claims
    }

    /// Median over plants of rise and settling, as a share of those without.
    fn response(&self, way: Way) -> Option<(f64, f64)> {
        let steps = || self.each(way).filter_map(|(a, m)| Some((a.step?, m.step?)));
        let rise = Spread::of(steps().map(|(a, m)| m.rise / a.rise))?;
        let settling = Spread::of(steps().map(|(a, m)| m.settling / a.settling))?;
        Some((rise.median, settling.median))
    }
}

#[cfg(test)]
mod tests {
    use super::Spread;

    #[test]
    fn a_spread_is_that_of_its_definition() {
        let of = |numbers: &[f64]| Spread::of(numbers.iter().copied());
        assert_eq!(
            of(&[3.0, 1.0, 2.0]),
            Some(Spread {
                median: 2.0,
                least: 1.0,
                most: 3.0
            })
        );
        assert_eq!(of(&[4.0, 1.0]).map(|s| s.median), Some(2.5));
        assert_eq!(of(&[]), None);
    }
}
