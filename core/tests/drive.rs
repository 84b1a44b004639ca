//! The drive through its faults and states: what is wrong turns the bridge off in the period that its page says.

use bristle_core::control::{CurrentLoop, SetPoint};
use bristle_core::drive::signal::{Selection, Signal};
use bristle_core::drive::{
    Actuation, Drive, Fault, Faults, News, Number, Parameters, Refusal, Sample, State,
};
use bristle_core::scalar::{Q16, Scalar};

const HEALTHY: Sample = Sample {
    count: 100,
    current: 2048,
    // 24 V at 1/64 V a count.
    bus: 1536,
    gate_fault: false,
};

fn news<T: Number>(command: f64) -> News<T> {
    News {
        set_point: Some(SetPoint::Command(T::from_f64(command))),
        heard: true,
        missed: false,
    }
}

fn parameters<T: Number>() -> Parameters<T> {
    let mut set = Parameters::harmless();
    set.control.command_limit = T::ONE;
    set.control.torque_limit = T::ONE;
    let limits = &mut set.limits;
    limits.current_per_count = T::from_f64(1.0 / 64.0);
    limits.current = T::from_f64(20.0);
    limits.bus_per_count = T::from_f64(1.0 / 64.0);
    limits.bus_min = T::from_f64(8.0);
    limits.bus_max = T::from_f64(56.0);
    limits.stall = T::from_f64(0.9);
    (limits.jump, limits.stall_periods) = (50, 15);
    (limits.command_timeout, limits.link_timeout) = (10, 20);
    set
}

fn drive<T: Number>() -> Drive<'static, T> {
    let mut drive = Drive::new(parameters(), Faults::NONE, &mut []).expect("a valid set");
    drive.enable().expect("nothing is wrong");
    for _ in 0..5 {
        assert!(drive.step(&HEALTHY, &news(0.5)).bridge);
    }
    drive
}

/// The number of periods, from the first one of `period`, in which the bridge is still on; then it must stay off.
fn periods_on<T: Number>(
    drive: &mut Drive<'static, T>,
    fault: Fault,
    mut period: impl FnMut(u16) -> (Sample, News<T>),
) -> u16 {
    for k in 0..1000 {
        let (sample, news) = period(k);
        let Actuation { input, bridge } = drive.step(&sample, &news);
        if !bridge {
            assert!(input == T::ZERO && drive.state() == State::Faulted);
            assert!(drive.faults().contains(fault), "{:?}", drive.faults());
            assert!(!drive.step(&HEALTHY, &self::news(0.5)).bridge);
            return k;
        }
        assert!(drive.faults().is_empty());
    }
    panic!("{fault:?} was not noticed");
}

fn silent<T>(heard: bool) -> News<T> {
    News {
        set_point: None,
        heard,
        missed: false,
    }
}

/// Every fault that samples or silence bring about, in one number format.
fn faults_are_noticed_in_time<T: Number>() {
    let on = |fault, period: &dyn Fn(u16) -> (Sample, News<T>)| {
        periods_on(&mut drive::<T>(), fault, period)
    };
    let sample = |change: fn(&mut Sample)| {
        let mut sample = HEALTHY;
        change(&mut sample);
        (sample, news(0.5))
    };
    // The bad sample's own period.
    assert_eq!(on(Fault::EncoderJump, &|_| sample(|s| s.count = 151)), 0);
    assert_eq!(on(Fault::EncoderJump, &|_| sample(|s| s.count = 49)), 0);
    assert_eq!(on(Fault::Overcurrent, &|_| sample(|s| s.current = 4000)), 0);
    assert_eq!(on(Fault::Overcurrent, &|_| sample(|s| s.current = 0)), 0);
    assert_eq!(on(Fault::Undervoltage, &|_| sample(|s| s.bus = 500)), 0);
    assert_eq!(on(Fault::Overvoltage, &|_| sample(|s| s.bus = 4000)), 0);
    assert_eq!(
        on(Fault::GateDriver, &|_| sample(|s| s.gate_fault = true)),
        0
    );
    let missed = News {
        missed: true,
        ..news(0.5)
    };
    assert_eq!(on(Fault::Overrun, &|_| (HEALTHY, missed)), 0);
    // Ten and twenty silent periods are allowed.
    assert_eq!(on(Fault::StaleCommand, &|_| (HEALTHY, silent(true))), 10);
    // The input is one period older than the sample, so the first of these is still the healthy one's.
    assert_eq!(on(Fault::EncoderLoss, &|_| (HEALTHY, news(1.0))), 15);
    let mut patient = drive::<T>();
    patient.disable();
    let mut set = parameters();
    set.limits.command_timeout = 0;
    patient.set(&set).expect("off is allowed");
    patient.enable().expect("nothing is wrong");
    let alone = |_| (HEALTHY, silent(false));
    assert_eq!(periods_on(&mut patient, Fault::LinkLoss, alone), 20);
}

#[test]
fn faults_are_noticed_in_time_in_every_number_format() {
    faults_are_noticed_in_time::<f64>();
    faults_are_noticed_in_time::<f32>();
    faults_are_noticed_in_time::<Q16>();
}

#[test]
fn a_number_that_is_none_is_noticed_in_its_period_and_forgotten_when_cleared() {
    let mut drive = drive::<f32>();
    let unsound = News {
        set_point: Some(SetPoint::Torque(f32::NAN)),
        ..news(0.5)
    };
    let at_once = periods_on(&mut drive, Fault::Unsound, |_| (HEALTHY, unsound));
    assert_eq!(at_once, 0);
    drive.clear();
    drive.enable().expect("the state was reset");
    assert!((0..100).all(|_| drive.step(&HEALTHY, &news(0.5)).bridge));
}

/// An axis that runs away in fixed point: velocity saturates long before anything overflows unnoticed.
#[test]
fn a_saturated_number_is_noticed() {
    let mut set = parameters::<Q16>();
    set.control.count = Q16::from_f64(1000.0);
    set.control.period = Q16::from_f64(0.01);
    set.control.observer_bandwidth = Q16::from_f64(500.0);
    let mut drive = Drive::<Q16>::new(set, Faults::NONE, &mut []).expect("a valid set");
    drive.enable().expect("nothing is wrong");
    let racing = |k: u16| {
        (
            Sample {
                count: 40 * k,
                ..HEALTHY
            },
            news(0.0),
        )
    };
    assert!(periods_on(&mut drive, Fault::Unsound, racing) < 10);
}

#[test]
fn damaged_parameters_are_noticed_when_they_are_compared() {
    let mut drive = drive::<f32>();
    drive.verify();
    assert_eq!(drive.state(), State::Running);
    drive.corrupt();
    drive.verify();
    assert!(drive.faults().contains(Fault::CorruptParameters));
    assert!(!drive.step(&HEALTHY, &news(0.5)).bridge);
    drive.clear();
    drive.set(&parameters()).expect("a new set heals");
    drive.verify();
    assert_eq!(drive.state(), State::Off);
}

#[test]
fn a_cause_that_persists_comes_back_and_one_that_is_gone_does_not() {
    let mut drive = drive::<f32>();
    let hot = Sample {
        current: 4000,
        ..HEALTHY
    };
    drive.step(&hot, &news(0.5));
    assert_eq!(drive.enable(), Err(Refusal::Faulted));
    drive.clear();
    drive.step(&hot, &news(0.5));
    assert_eq!(drive.state(), State::Faulted);
    drive.clear();
    drive.enable().expect("the cause is gone");
    assert!(drive.step(&HEALTHY, &news(0.5)).bridge);
}

#[test]
fn the_input_is_limited_and_zero_when_off() {
    let mut drive = drive::<f32>();
    for (wanted, input) in [(0.25, 0.25), (7.0, 1.0), (-7.0, -1.0)] {
        assert_eq!(drive.step(&HEALTHY, &news(wanted)).input, input);
    }
    drive.disable();
    let off = drive.step(&HEALTHY, &news(0.5));
    assert_eq!((off.input, off.bridge), (0.0, false));
    // What only matters under power is no fault without it.
    let unpowered = Sample { bus: 0, ..HEALTHY };
    (0..100).for_each(|_| assert!(!drive.step(&unpowered, &silent(false)).bridge));
    assert_eq!(drive.state(), State::Off);
}

const LOOP: CurrentLoop<f32> = CurrentLoop {
    proportional: 1.0,
    reset: 0.5,
    back_emf: 0.05,
    limit: 24.0,
};

/// What a set says otherwise.
type Change = fn(&mut Parameters<f32>);

#[test]
fn a_running_axis_keeps_what_must_not_change_and_its_mode() {
    let fixed: [(&str, Change); 18] = [
        ("jump", |p| p.limits.jump += 1),
        ("current scale", |p| p.limits.current_per_count *= -1.0),
        ("current zero", |p| p.limits.current_zero += 1),
        ("current", |p| p.limits.current *= 2.0),
        ("bus scale", |p| p.limits.bus_per_count *= 1.5),
        ("least bus", |p| p.limits.bus_min = 0.0),
        ("largest bus", |p| p.limits.bus_max *= 2.0),
        ("stall", |p| p.limits.stall *= 2.0),
        ("stall periods", |p| p.limits.stall_periods += 1),
        ("command timeout", |p| p.limits.command_timeout = 0),
        ("link timeout", |p| p.limits.link_timeout = 0),
        ("period", |p| p.control.period *= 2.0),
        ("count", |p| p.control.count *= 2.0),
        ("polarity", |p| p.control.gain *= -1.0),
        ("back EMF", |p| p.control.back_emf = 0.1),
        ("command limit", |p| p.control.command_limit = 2.0),
        ("torque limit", |p| p.control.torque_limit = 2.0),
        ("current loop", |p| p.current = Some(LOOP)),
    ];
    for (what, change) in fixed {
        let mut drive = drive::<f32>();
        let mut other = parameters();
        change(&mut other);
        assert_eq!(drive.set(&other), Err(Refusal::Fixed), "{what}");
        assert_eq!(*drive.parameters(), parameters(), "{what}");
        drive.disable();
        assert_eq!(drive.set(&other), Ok(()), "{what}");
        assert_eq!(*drive.parameters(), other, "{what}");
    }
    assert_eq!(drive::<f32>().enable(), Err(Refusal::Running));
}

#[test]
fn numbers_out_of_range_are_refused_running_or_not() {
    let bad: [Change; 7] = [
        |p| p.current = Some(CurrentLoop { reset: 1.5, ..LOOP }),
        |p| p.limits.bus_max = f32::NAN,
        |p| p.control.inertia = f32::NAN,
        |p| p.control.velocity_gain = f32::INFINITY,
        |p| p.control.friction.coulomb = -0.1,
        |p| p.control.effects.offset = f32::NAN,
        |p| p.control.adaptation.lowest = 2.0 * p.control.adaptation.highest + 1.0,
    ];
    for change in bad {
        let mut drive = drive::<f32>();
        let mut invalid = parameters();
        change(&mut invalid);
        for _ in 0..2 {
            assert_eq!(drive.set(&invalid), Err(Refusal::Invalid));
            assert_eq!(*drive.parameters(), parameters());
            drive.disable();
        }
    }
}

/// Parameters under way neither hide a fault nor stop a clock that runs.
#[test]
fn a_set_under_way_is_in_force_in_the_next_period_and_is_no_set_point() {
    let mut drive = drive::<f32>();
    let mut other = parameters();
    other.control.velocity_gain = 0.25;
    let velocity = SetPoint::Velocity {
        velocity: 1.0,
        acceleration: 0.0,
    };
    let asked = News {
        set_point: Some(velocity),
        ..news(0.0)
    };
    // Without gains nothing comes of it.
    assert_eq!(drive.step(&HEALTHY, &asked).input, 0.0);
    assert_eq!(drive.set(&other), Ok(()));
    assert_eq!(drive.step(&HEALTHY, &asked).input, 0.25);
    drive.verify();
    assert_eq!(drive.state(), State::Running);
    let stale = periods_on(&mut drive, Fault::StaleCommand, |_| (HEALTHY, silent(true)));
    assert_eq!(stale, 10);
    let mut drive = self::drive::<f32>();
    let mut set = false;
    let stale = (0..100).position(|_| {
        set = !set;
        let next = if set { other } else { parameters() };
        assert_eq!(drive.set(&next), Ok(()));
        !drive.step(&HEALTHY, &silent(true)).bridge
    });
    assert_eq!(stale, Some(10));
}

#[test]
fn a_fault_from_before_the_first_period_is_latched() {
    let mut faults = Faults::NONE;
    faults.raise(Fault::Watchdog);
    let mut drive = Drive::<f32>::new(parameters(), faults, &mut []).expect("a valid set");
    assert_eq!(drive.enable(), Err(Refusal::Faulted));
    drive.clear();
    assert_eq!(drive.enable(), Ok(()));
}

#[test]
fn telemetry_is_due_as_often_as_was_asked() {
    let mut drive = drive::<f32>();
    let wanted = Selection::of(&[Signal::Input, Signal::Bus]);
    drive.stream(wanted, 4);
    let mut due = 0;
    for _ in 0..40 {
        drive.step(&HEALTHY, &news(0.5));
        if let Some(selection) = drive.due() {
            let expected = [0.5_f32, 24.0].map(f32::to_bits);
            assert_eq!(drive.snapshot().chosen(selection), expected);
            due += 1;
        }
    }
    assert_eq!(due, 10);
    drive.stream(wanted, 0);
    assert!(drive.due().is_none());
}
