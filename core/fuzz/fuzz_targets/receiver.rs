//! Bytes as they may come over the link, through the receiver and all that a command can do to a drive.
#![no_main]

use bristle_core::drive::{Drive, Faults, News, Parameters, Sample};
use bristle_core::link::{Command, Packet, Received, Receiver, encode, serve};
use libfuzzer_sys::fuzz_target;

fn act(drive: &mut Drive<f32>, receiver: &Receiver, received: Received<f32>) {
    let mut news = News::NONE;
    match received {
        Received::Sample(sample) => {
            drive.step(&sample, &news);
            drive.due();
            drive.verify();
        }
        Received::SetPoint(set_point) => {
            news.set_point = Some(set_point);
            drive.step(&Sample::default(), &news);
        }
        Received::Packet(packet) => drop(serve(drive, receiver.counters(), &packet.command)),
    }
}

fuzz_target!(|bytes: &[u8]| {
    let mut ring = [0; 64];
    let mut drive = Drive::<f32>::new(Parameters::harmless(), Faults::NONE, &mut ring).expect("a valid set");
    let mut receiver = Receiver::new();
    for &byte in bytes {
        if let Some(received) = receiver.push(byte) {
            act(&mut drive, &receiver, received);
        }
    }
    // The same bytes as the content of frames, which gets past the checksum.
    for content in bytes.chunks(48) {
        if let Ok((packet, _)) = postcard::take_from_bytes::<Packet<f32>>(content)
            && let Ok(frame) = encode(&packet)
        {
            let received = frame.iter().find_map(|&byte| receiver.push(byte));
            if let Some(received) = received {
                act(&mut drive, &receiver, received);
            }
        }
    }
    // Whatever came, the next command is understood.
    receiver.push::<f32>(0);
    let hello = Packet::<f32> {
        sequence: 0,
        command: Command::Hello,
    };
    let frame = encode(&hello).expect("every packet fits a frame");
    let received = frame.iter().find_map(|&byte| receiver.push(byte));
    assert_eq!(received, Some(Received::Packet(hello)));
});
