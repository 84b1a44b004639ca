//! Instructions of parameters that come while the axis runs, which hold up the period that they come in: prints the median
//! and the largest count of `Drive::set`.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod bench;

#[cfg(not(target_os = "none"))]
fn main() {}

#[cfg(target_os = "none")]
#[cortex_m_rt::entry]
fn main() -> ! {
    use bristle_core::drive::Fault;

    bench::run(|counter| {
        let mut counts = [0; bench::PERIODS];
        let mut ring = [0; bench::RING];
        let mut next = bench::parameters();
        bench::drive(&mut counts, &mut ring, |drive, sample, news| {
            bench::retune(&mut next.control);
            let (count, taken) = counter.count(|| drive.set(&next));
            // What is refused costs less, and is not what is to be counted: the run is to fail.
            if taken.is_err() {
                drive.raise(Fault::Unsound);
            }
            (count, drive.step(sample, news).input)
        })?;
        bench::report("set", &mut counts);
        Some(())
    })
}
