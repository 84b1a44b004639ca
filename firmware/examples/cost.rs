//! Instructions of a control period, counted by the emulator: run with `-icount shift=0`, where TIM5 counts one for each.
//!
//! An axis with Coulomb friction follows a sine under full compensation, with a recording of two signals. Prints, for the
//! whole of `Drive::step` and for the control law in it alone, the median and the largest count.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(not(target_os = "none"))]
fn main() {}

#[cfg(target_os = "none")]
mod target {
    use bristle_core::control::{
        Compensation, Controller, Driver, Friction, Harmonic, Learning, Method, Position, SetPoint,
    };
    use bristle_core::drive::recorder::{Order, Trigger};
    use bristle_core::drive::signal::{Selection, Signal};
    use bristle_core::drive::{Drive, Faults, News, Parameters, Sample};
    use bristle_core::friction::Curve;
    use bristle_core::scalar::Scalar;
    use bristle_firmware::board::device::{Peripherals, TIM5};
    use bristle_firmware::fault::{self, PANIC_STATUS};
    use semihosting::println;

    const PERIODS: usize = 4000;
    const COUNT: f32 = 3.834_952e-4;
    const PERIOD: f32 = 1e-3;

    fn parameters() -> Parameters<f32> {
        let mut set = Parameters::harmless();
        set.limits.bus_max = 1e3;
        set.limits.current = 1e3;
        let control = &mut set.control;
        (control.period, control.count, control.inertia) = (PERIOD, COUNT, 2e-3);
        (control.command_limit, control.torque_limit) = (1.0, 1.0);
        control.observer_bandwidth = 800.0;
        (control.position_gain, control.velocity_gain) = (50.0, 0.4);
        control.velocity_integral = 10.0;
        control.friction = Friction {
            coulomb: 0.2,
            viscous: 0.015,
            static_level: 0.25,
            stribeck_velocity: 0.1,
            curve: Curve::Rational,
            bristle_stiffness: 200.0,
            bristle_damping: 0.3,
        };
        control.compensation = Compensation {
            method: Method::Static,
            driver: Driver::Command,
            share: 1.0,
            slope: 0.3,
            crossing: 0.01,
        };
        control.adaptation.method = Learning::Observer;
        (control.adaptation.rate, control.adaptation.speed) = (10.0, 0.1);
        control.adaptation.highest = 1.0;
        control.effects.waves[0] = Harmonic {
            cycle: 1 << 18,
            sine: 0.1,
            cosine: 0.02,
        };
        set
    }

    /// An axis with Coulomb friction, in explicit steps: what it does hardly matters, as long as it moves and sticks.
    struct Axis {
        q: f32,
        v: f32,
    }

    impl Axis {
        fn advance(&mut self, torque: f32) {
            let free = self.v + torque * (PERIOD / 2e-3);
            let brake = 0.2 * (PERIOD / 2e-3);
            self.v = free - free.clamp_symmetric(brake);
            self.q += self.v * PERIOD;
        }
        fn counts(&self) -> i32 {
            (self.q / COUNT).floor()
        }
    }

    /// A sine of 1 Hz and half a radian.
    fn aim(k: usize) -> SetPoint<f32> {
        let phase = (k as u32).wrapping_mul((1_u64 << 32).div_euclid(1000) as u32);
        let (sine, cosine) = f32::wave(phase);
        let omega = core::f32::consts::TAU;
        SetPoint::Position {
            position: Position::at(0).moved(0.5 / COUNT * sine),
            velocity: 0.5 * omega * cosine,
            acceleration: -0.5 * omega * omega * sine,
        }
    }

    struct Counter(TIM5);

    impl Counter {
        fn count<T>(&self, work: impl FnOnce() -> T) -> (u32, T) {
            let before = self.0.cnt().read().bits();
            let done = work();
            (self.0.cnt().read().bits().wrapping_sub(before), done)
        }
    }

    fn report(name: &str, counts: &mut [u32], bracket: u32) {
        counts.sort_unstable();
        let at = |k: usize| counts.get(k).map_or(0, |c| c - bracket);
        println!("{name} {} {}", at(PERIODS / 2), at(PERIODS - 1));
    }

    fn whole(counter: &Counter, counts: &mut [u32], ring: &mut [u32]) -> Option<()> {
        let mut drive = Drive::new(parameters(), Faults::NONE, ring)?;
        drive.recorder().start(Order {
            selection: Selection::of(&[Signal::Input, Signal::Position]),
            every: 1,
            trigger: Trigger::Now,
            before: 0,
        });
        drive.enable().ok()?;
        let mut axis = Axis { q: 0.0, v: 0.0 };
        for (k, slot) in counts.iter_mut().enumerate() {
            let sample = Sample {
                count: axis.counts() as u16,
                current: 2048,
                bus: 100,
                gate_fault: false,
            };
            let news = News {
                set_point: Some(aim(k)),
                heard: true,
                missed: false,
            };
            let (count, actuation) = counter.count(|| drive.step(&sample, &news));
            *slot = count;
            axis.advance(actuation.input);
            if !actuation.bridge {
                return None;
            }
        }
        Some(())
    }

    fn law(counter: &Counter, counts: &mut [u32]) -> Option<()> {
        let mut controller = Controller::new(parameters().control, 0).ok()?;
        let mut axis = Axis { q: 0.0, v: 0.0 };
        for (k, slot) in counts.iter_mut().enumerate() {
            let (position, set_point) = (axis.counts(), aim(k));
            let (count, output) = counter.count(|| controller.step(position, set_point));
            *slot = count;
            axis.advance(output.command);
        }
        Some(())
    }

    #[cortex_m_rt::entry]
    fn main() -> ! {
        let Some(device) = Peripherals::take() else {
            fault::stop(PANIC_STATUS)
        };
        device.TIM5.cr1().write(|w| w.cen().enabled());
        let counter = Counter(device.TIM5);
        let (bracket, ()) = counter.count(|| ());
        let mut counts = [0; PERIODS];
        let mut ring = [0; 4096];
        if whole(&counter, &mut counts, &mut ring).is_none() {
            fault::stop(PANIC_STATUS);
        }
        report("step", &mut counts, bracket);
        if law(&counter, &mut counts).is_none() {
            fault::stop(PANIC_STATUS);
        }
        report("law", &mut counts, bracket);
        semihosting::process::exit(0)
    }
}
