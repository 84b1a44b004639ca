//! Instructions of a control period by its stages: prints median and largest count of the control law alone and of each stage
//! of `Drive::step`. A stage that is entered twice is counted whole. The stages come to more than the step, as the
//! compiler may not mix what is measured apart.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod bench;

#[cfg(not(target_os = "none"))]
fn main() {}

#[cfg(target_os = "none")]
mod target {
    use core::hint::black_box;

    use bristle_core::control::{Controller, Probe, Stage};

    use crate::bench::{Axis, Counter, PERIODS, RING, aim, drive, parameters, report, run};

    /// Counts the instructions of one stage.
    struct Watch<'a> {
        counter: &'a Counter,
        stage: Stage,
        last: u32,
        count: u32,
    }

    impl Probe for Watch<'_> {
        #[inline]
        fn ended(&mut self, stage: Stage) {
            let now = self.counter.now();
            if stage == self.stage {
                self.count += now.wrapping_sub(self.last) - self.counter.bracket;
            }
            self.last = self.counter.now();
        }
    }

    fn law(counter: &Counter, counts: &mut [u16]) -> Option<()> {
        let mut controller = Controller::new(parameters().control, 0).ok()?;
        // By its address, as the firmware has it.
        let controller = black_box(&mut controller);
        let mut axis = Axis::START;
        for (k, slot) in counts.iter_mut().enumerate() {
            let (position, set_point) = black_box((axis.counts(), aim(k)));
            let (count, output) = counter.count(|| controller.step(position, set_point));
            *slot = u16::try_from(count).unwrap_or(u16::MAX);
            axis.advance(output.command);
        }
        Some(())
    }

    const fn name(stage: Stage) -> &'static str {
        match stage {
            Stage::Monitor => "monitor",
            Stage::Observer => "observer",
            Stage::Estimator => "estimator",
            Stage::Effects => "effects",
            Stage::Controller => "controller",
            Stage::Compensation => "compensation",
            Stage::Limits => "limits",
            Stage::Memory => "memory",
            Stage::Current => "current",
            Stage::Record => "record",
        }
    }

    #[cortex_m_rt::entry]
    fn main() -> ! {
        run(|counter| {
            let mut counts = [0; PERIODS];
            law(counter, &mut counts)?;
            report("law", &mut counts);
            let mut ring = [0; RING];
            for stage in Stage::ALL {
                drive(&mut counts, &mut ring, |drive, sample, news| {
                    let mut watch = Watch {
                        counter,
                        stage,
                        last: counter.now(),
                        count: 0,
                    };
                    let actuation = drive.step_probed(sample, news, &mut watch);
                    (watch.count, actuation.input)
                })?;
                report(name(stage), &mut counts);
            }
            Some(())
        })
    }
}
