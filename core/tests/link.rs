//! The receiver under noise: whatever comes, it counts, does not panic, and is back in step at the next frame.

use bristle_core::control::SetPoint;
use bristle_core::link::{Command, Packet, Received, Receiver, Report, decode, encode};
use proptest::prelude::{ProptestConfig, any, proptest};
use proptest::{collection::vec, prop_assert, prop_assert_eq};

fn packet(sequence: u16, command: Command<f32>) -> Vec<u8> {
    let frame = encode(&Packet { sequence, command });
    frame.expect("every packet fits a frame").to_vec()
}

fn receive(receiver: &mut Receiver, bytes: &[u8]) -> Vec<Received<f32>> {
    bytes.iter().filter_map(|&b| receiver.push(b)).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn noise_is_counted_and_the_next_frame_is_whole(
        noise in vec(any::<u8>(), 0..600),
        at_a_zero in any::<bool>(),
    ) {
        let mut receiver = Receiver::new();
        let mut stream = noise;
        if at_a_zero {
            stream.iter_mut().step_by(7).for_each(|byte| *byte = 0);
        }
        stream.push(0);
        let from_noise = receive(&mut receiver, &stream);
        // A checksum of 16 bits lets one frame of noise in 65,536 pass, if it holds a message at all.
        prop_assert!(from_noise.len() <= 1);
        let frames = stream.split(|b| *b == 0).filter(|f| !f.is_empty()).count();
        prop_assert_eq!(receiver.counters().damaged as usize, frames - from_noise.len());
        let received = receive(&mut receiver, &packet(7, Command::SetPoint(SetPoint::Command(0.5))));
        prop_assert_eq!(received, [Received::SetPoint(SetPoint::Command(0.5))]);
    }

    #[test]
    fn a_valid_frame_with_damage_is_refused_or_unharmed(
        place in any::<proptest::sample::Index>(),
        flip in 1..=255_u8,
        value in any::<f32>(),
    ) {
        let clean = packet(1, Command::SetPoint(SetPoint::Torque(value)));
        let mut damaged = clean.clone();
        let at = place.index(clean.len());
        damaged[at] ^= flip;
        damaged.push(0);
        let mut receiver = Receiver::new();
        prop_assert_eq!(receive(&mut receiver, &damaged), []);
        prop_assert!(receiver.counters().damaged >= 1);
    }

    #[test]
    fn lost_packets_are_counted(first in any::<u16>(), lost in 0..60_000_u16) {
        let mut receiver = Receiver::new();
        receive(&mut receiver, &packet(first, Command::Hello));
        let next = first.wrapping_add(lost).wrapping_add(1);
        receive(&mut receiver, &packet(next, Command::Hello));
        prop_assert_eq!(receiver.counters().missing, u32::from(lost));
    }

    /// The host's end decodes what a board, or noise, sends.
    #[test]
    fn reports_from_noise_do_not_panic(noise in vec(any::<u8>(), 0..140)) {
        let _ = decode::<Report<f32>>(&mut noise.clone());
    }
}
