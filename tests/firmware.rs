//! The firmware in the emulator: the image that would be flashed, driven through its real receive interrupt.
//!
//! Needs `qemu-system-arm` and the target `thumbv7em-none-eabihf`. Without them the tests say so and pass, unless
//! `BRISTLE_REQUIRE_QEMU=1` is set.
#![cfg(unix)]

mod emulator;

use bristle_core::friction::{CoulombViscous, Curve, Friction, Stribeck};
use bristle_core::link::{
    CHUNK, Deframer, Law, PROTOCOL_VERSION, Rejection, Request, Response, Samples, decode, encode,
};
use emulator::{Board, images, run_to_end, runnable_images};
use object::{Object, ObjectSection, SectionFlags, SectionKind, elf};

const COULOMB_VISCOUS: CoulombViscous<f32> = CoulombViscous {
    coulomb: 0.217,
    viscous: 0.0123,
};

const fn stribeck(curve: Curve) -> Stribeck<f32> {
    Stribeck {
        coulomb: 0.217,
        viscous: 0.0123,
        static_level: 0.351,
        stribeck_velocity: 0.0876,
        curve,
    }
}

const HELLO: Response = Response::Hello {
    version: PROTOCOL_VERSION,
    chunk: CHUNK as u16,
};

/// A board that has greeted, or `None` on a machine without emulator or target.
fn booted() -> Option<Board> {
    let mut board = Board::boot(&runnable_images()?.firmware);
    assert_eq!(board.receive(), HELLO);
    Some(board)
}

/// Both zeros, the extremes of the format, and every magnitude between in both directions.
fn velocities() -> Vec<f32> {
    let smallest = f32::from_bits(1);
    let magnitudes = [
        0.0,
        smallest,
        f32::MIN_POSITIVE,
        f32::EPSILON,
        1e9,
        1e30,
        f32::MAX,
    ];
    // 151 steps of a factor 1.37 from 1e-10 pass through the curve's whole range, at values of no special form.
    let geometric = std::iter::successors(Some(1e-10_f32), |v| Some(v * 1.37)).take(151);
    magnitudes
        .into_iter()
        .chain(geometric)
        .flat_map(|v| [v, -v])
        .collect()
}

fn evaluate(sequence: u16, velocities: &[f32]) -> Request {
    Request::Evaluate {
        sequence,
        velocities: Samples::from_slice(velocities).expect("at most a chunk"),
    }
}

/// Asserts that the board's forces are the host's, bit for bit.
///
/// The host's come from the friction law itself and not by way of [`Law`], so a mix-up of parameters on the
/// wire cannot cancel.
fn assert_same_forces(board: &mut Board, law: Law, reference: &impl Friction<f32>) {
    assert_eq!(board.ask(&Request::SetLaw(law)), Response::LawSet);
    for (sequence, chunk) in (0..).zip(velocities().chunks(CHUNK)) {
        let Response::Forces {
            sequence: answered,
            forces,
        } = board.ask(&evaluate(sequence, chunk))
        else {
            panic!("the board refused chunk {sequence} under {law:?}");
        };
        assert_eq!(answered, sequence);
        assert_eq!(forces.len(), chunk.len());
        for (&velocity, &force) in chunk.iter().zip(&forces) {
            let expected = reference.sliding(velocity);
            assert_eq!(
                force.to_bits(),
                expected.to_bits(),
                "at {velocity:e}: {force:e} on the board, {expected:e} on the host, under {law:?}"
            );
        }
    }
}

#[test]
fn forces_equal_the_hosts_bit_for_bit() {
    let Some(mut board) = booted() else { return };
    let law = COULOMB_VISCOUS;
    assert_same_forces(&mut board, Law::CoulombViscous(law), &law);
    for curve in [Curve::Exponential, Curve::Rational] {
        let law = stribeck(curve);
        assert_same_forces(&mut board, Law::Stribeck(law), &law);
    }
}

#[test]
fn garbage_between_frames_is_counted_and_does_not_stop_the_loop() {
    let Some(mut board) = booted() else { return };
    let mut expected = 0;
    for seed in 1..=8 {
        let noise = noise(seed);
        expected += frames_in(&noise);
        board.send_raw(&noise);
        await_rejections(&mut board, expected);
        // Right behind the noise, and then for good measure the law itself.
        assert_eq!(board.ask(&Request::Hello), HELLO);
    }
    let law = stribeck(Curve::Rational);
    assert_same_forces(&mut board, Law::Stribeck(law), &law);
}

/// Some 700 reproducible bytes, ended by a delimiter; the higher the seed, the rarer the delimiters inside, up to
/// frames that are too long.
fn noise(seed: u32) -> Vec<u8> {
    let mut state = seed.wrapping_mul(0x9E37_79B9);
    let mut bytes: Vec<u8> = (0..700)
        .map(|_| {
            // xorshift32 (Marsaglia 2003)
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            let rare_zero = state.trailing_zeros() >= seed;
            if rare_zero {
                0
            } else {
                (state >> 24) as u8 | 1
            }
        })
        .collect();
    bytes.push(0);
    bytes
}

/// How many frames a receiver sees in `bytes`, all of them bad.
fn frames_in(bytes: &[u8]) -> u32 {
    let mut deframer = Deframer::new();
    let frames = bytes.iter().filter_map(|&byte| deframer.push(byte));
    let bad = frames.map(|frame| assert!(frame.and_then(decode::<Request>).is_err()));
    bad.count() as u32
}

/// Reads refusals until the board has counted `total` since boot, and not one more.
///
/// Noise comes faster than a board answers, so several frames may share one [`Rejection::Overrun`].
fn await_rejections(board: &mut Board, total: u32) {
    loop {
        match board.receive() {
            Response::Rejected { total: so_far, .. } if so_far < total => {}
            Response::Rejected { total: so_far, .. } => return assert_eq!(so_far, total),
            other => panic!("an answer to noise: {other:?}"),
        }
    }
}

#[test]
fn a_flood_of_requests_is_answered_in_order_or_accounted_for() {
    const REQUESTS: u16 = 200;
    let Some(mut board) = booted() else { return };
    let law = Law::CoulombViscous(COULOMB_VISCOUS);
    assert_eq!(board.ask(&Request::SetLaw(law)), Response::LawSet);
    let flood: Vec<u8> = (0..REQUESTS)
        .flat_map(|sequence| encode(&evaluate(sequence, &[1.0; CHUNK])).expect("a frame"))
        .collect();
    board.send_raw(&flood);

    let (mut answered, mut dropped, mut last) = (0, 0, None);
    while answered + dropped < u32::from(REQUESTS) {
        match board.receive() {
            Response::Forces { sequence, .. } => {
                assert!(last < Some(sequence), "{last:?} before {sequence}");
                last = Some(sequence);
                answered += 1;
            }
            Response::Rejected {
                reason: Rejection::Overrun,
                total,
            } => dropped = total,
            other => panic!("an answer to something else: {other:?}"),
        }
    }
    assert_eq!(board.ask(&Request::Hello), HELLO);
}

#[test]
fn bad_requests_are_refused_by_name() {
    let Some(mut board) = booted() else { return };
    let rejected = |reason, total| Response::Rejected { reason, total };
    let negative = Law::CoulombViscous(CoulombViscous {
        coulomb: -1.0,
        ..COULOMB_VISCOUS
    });
    assert_eq!(
        board.ask(&evaluate(1, &[1.0])),
        rejected(Rejection::NoLaw, 1)
    );
    assert_eq!(
        board.ask(&Request::SetLaw(negative)),
        rejected(Rejection::InvalidLaw, 2)
    );
    let law = Law::CoulombViscous(COULOMB_VISCOUS);
    assert_eq!(board.ask(&Request::SetLaw(law)), Response::LawSet);
    assert_eq!(
        board.ask(&evaluate(2, &[f32::NAN])),
        rejected(Rejection::NotFinite, 3)
    );
}

#[test]
fn faults_end_the_emulation_with_their_own_status() {
    let Some(images) = runnable_images() else {
        return;
    };
    assert_eq!(run_to_end(&images.panic).code(), Some(101));
    assert_eq!(run_to_end(&images.hard_fault).code(), Some(102));
}

#[test]
fn the_image_fits_its_budget() {
    let Some(images) = images() else { return };
    let image = std::fs::read(&images.firmware).expect("the image was just built");
    let budget = include_str!("../firmware/budget.toml");
    let budget: toml_edit::DocumentMut = budget.parse().expect("the budget is TOML");
    for (key, used) in [
        ("flash_bytes", occupied(&image, in_flash)),
        ("static_ram_bytes", occupied(&image, in_ram)),
    ] {
        let limit = budget[key].as_integer().expect("the budget is a number");
        let limit = u64::try_from(limit).expect("the budget is positive");
        println!("{key}: {used} of {limit}");
        assert!(
            used > 0 && used <= limit,
            "{key}: {used}, the budget is {limit}"
        );
    }
}

/// The bytes of the sections that `counts` picks from those that exist on the target at all.
fn occupied(image: &[u8], counts: impl Fn(SectionKind, u64) -> bool) -> u64 {
    let image = object::File::parse(image).expect("the image is an ELF file");
    image
        .sections()
        .filter(|section| match section.flags() {
            SectionFlags::Elf { sh_flags } => {
                sh_flags & u64::from(elf::SHF_ALLOC) != 0 && counts(section.kind(), sh_flags)
            }
            _ => false,
        })
        .map(|section| section.size())
        .sum()
}

/// Everything with content, as also the initial values of variables are kept there.
fn in_flash(kind: SectionKind, _: u64) -> bool {
    kind != SectionKind::UninitializedData
}

/// Everything writable, with initial values or without.
fn in_ram(_: SectionKind, flags: u64) -> bool {
    flags & u64::from(elf::SHF_WRITE) != 0
}
