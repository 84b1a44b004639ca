//! Instructions of a whole control period, as the firmware runs it: prints the median and the largest count of
//! `Drive::step`.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod bench;

#[cfg(not(target_os = "none"))]
fn main() {}

#[cfg(target_os = "none")]
#[cortex_m_rt::entry]
fn main() -> ! {
    bench::run(|counter| {
        let mut counts = [0; bench::PERIODS];
        let mut ring = [0; bench::RING];
        bench::drive(&mut counts, &mut ring, |drive, sample, news| {
            let (count, actuation) = counter.count(|| drive.step(sample, news));
            (count, actuation.input)
        })?;
        bench::report("step", &mut counts);
        Some(())
    })
}
