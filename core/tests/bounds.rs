//! The bounds of a run: what leaves them turns the bridge off in time, what is too large is cut, and they end with the run.

use bristle_core::control::SetPoint;
use bristle_core::drive::{
    Bounds, Drive, Fault, Faults, News, Number, Parameters, Refusal, Sample, State,
};
use bristle_core::scalar::Q16;

/// Of the observer, over a control period.
const BANDWIDTH: f64 = 0.125;

fn parameters<T: Number>() -> Parameters<T> {
    let mut set = Parameters::harmless();
    set.control.command_limit = T::ONE;
    set.control.torque_limit = T::ONE;
    set.control.observer_bandwidth = T::from_f64(BANDWIDTH);
    let limits = &mut set.limits;
    limits.current_per_count = T::from_f64(1.0 / 64.0);
    limits.current = T::from_f64(20.0);
    limits.stall_periods = 10_000;
    set
}

fn bounds<T: Number>() -> Bounds<T> {
    Bounds {
        travel: 500,
        speed: T::from_f64(8.0),
        input: T::from_f64(0.25),
        current: T::from_f64(4.0),
    }
}

/// A drive that is on within these bounds, where the encoder has counted `count`.
fn confined<T: Number>(bounds: &Bounds<T>, count: u16) -> Drive<'static, T> {
    let mut drive = Drive::new(parameters(), Faults::NONE, &mut []).expect("a valid set");
    let start = [0, 700, count].map(|count| step(&mut drive, count, 2048));
    assert_eq!(start, [(false, T::ZERO); 3]);
    drive.clear();
    drive.enable_within(bounds).expect("nothing is wrong");
    drive
}

/// A period; whether the bridge is on, and what it applies of an input of 0.5.
fn step<T: Number>(drive: &mut Drive<T>, count: u16, current: u16) -> (bool, T) {
    driven(drive, 0.5, count, current)
}

fn driven<T: Number>(drive: &mut Drive<T>, u: f64, count: u16, current: u16) -> (bool, T) {
    let sample = Sample {
        count,
        current,
        ..Sample::default()
    };
    let news = News {
        set_point: Some(SetPoint::Command(T::from_f64(u))),
        heard: true,
        missed: false,
    };
    let actuation = drive.step(&sample, &news);
    (actuation.bridge, actuation.input)
}

fn tripped<T: Number>(drive: &Drive<T>, fault: Fault) -> bool {
    drive.state() == State::Faulted && drive.faults().iter().eq([fault])
}

fn bounds_hold<T: Number>() {
    let wide = Bounds {
        speed: T::from_f64(1000.0),
        ..bounds()
    };
    for (inside, outside) in [(1500, 1501), (500, 499)] {
        let mut drive = confined(&wide, 1000);
        assert!(step(&mut drive, inside, 2048).0);
        assert!(!step(&mut drive, outside, 2048).0);
        assert!(tripped(&drive, Fault::Travel));
    }
    // 4 A are 256 counts of the converter.
    for (inside, outside) in [(2304, 2305), (1792, 1791)] {
        let mut drive = confined(&wide, 1000);
        assert!(step(&mut drive, 1000, inside).0);
        assert!(!step(&mut drive, 1000, outside).0);
        assert!(tripped(&drive, Fault::Overcurrent));
    }
}

#[test]
fn travel_and_current_end_a_run_in_the_period_that_shows_them() {
    bounds_hold::<f64>();
    bounds_hold::<f32>();
    bounds_hold::<Q16>();
}

/// The observer of a constant speed is ω²/(s + ω)² of it, without overshoot: half of the speed shows at ωt = 1.68.
fn speed_ends_a_run<T: Number>() {
    let run = |per_period: u16| {
        let far = Bounds {
            travel: 60_000,
            ..bounds::<T>()
        };
        let mut drive = confined(&far, 0);
        let on = (1..1000).take_while(|k| driven(&mut drive, 0.0, k * per_period, 2048).0);
        (on.count(), tripped(&drive, Fault::Overspeed))
    };
    assert_eq!(run(7), (999, false));
    let (periods, was_speed) = run(16);
    let expected = 1.68 / BANDWIDTH;
    assert!(
        was_speed && (periods as f64) < 1.2 * expected && periods as f64 > 0.5 * expected,
        "{periods} periods and not {expected}"
    );
}

#[test]
fn speed_ends_a_run_as_soon_as_the_observer_shows_it() {
    speed_ends_a_run::<f64>();
    speed_ends_a_run::<f32>();
    speed_ends_a_run::<Q16>();
}

fn input_is_cut<T: Number>() {
    let mut drive = confined::<T>(&bounds(), 0);
    assert_eq!(step(&mut drive, 0, 2048), (true, T::from_f64(0.25)));
    // The set in force is as it was: what compares it finds nothing.
    drive.verify();
    assert!(drive.faults().is_empty());
    // The parameter stays the narrower limit where it is one.
    let generous = Bounds {
        input: T::from_f64(100.0),
        ..bounds()
    };
    let mut narrow = parameters();
    narrow.control.command_limit = T::from_f64(0.125);
    let mut drive = Drive::new(narrow, Faults::NONE, &mut []).expect("a valid set");
    drive.enable_within(&generous).expect("nothing is wrong");
    assert_eq!(step(&mut drive, 0, 2048), (true, T::from_f64(0.125)));
}

#[test]
fn input_is_cut_to_the_narrower_of_bound_and_parameter() {
    input_is_cut::<f64>();
    input_is_cut::<f32>();
    input_is_cut::<Q16>();
}

#[test]
fn bounds_end_with_their_run_and_those_that_are_none_are_refused() {
    let mut drive = confined::<f32>(&bounds(), 0);
    assert_eq!(drive.enable_within(&bounds()), Err(Refusal::Running));
    drive.disable();
    // With the bridge off nothing is checked, and the next run has no bounds.
    assert!(!step(&mut drive, 600, 2048).0 && drive.faults().is_empty());
    drive.enable().expect("nothing is wrong");
    for count in (600..1800).step_by(100) {
        assert_eq!(step(&mut drive, count, 2048), (true, 0.5));
    }
    drive.disable();
    let bad: [fn(&mut Bounds<f32>); 5] = [
        |b| b.travel = 0,
        |b| b.speed = -1.0,
        |b| b.input = 0.0,
        |b| b.current = f32::NAN,
        |b| b.speed = f32::INFINITY,
    ];
    for spoil in bad {
        let mut none = bounds();
        spoil(&mut none);
        assert_eq!(drive.enable_within(&none), Err(Refusal::Invalid));
        assert_eq!(drive.state(), State::Off);
    }
}
