//! The motor driver: one image for the board and for the emulator, on a chip with a floating-point unit.
//!
//! | priority | task | what it does |
//! | --- | --- | --- |
//! | 5 | `control` | a control period: sample, [`Drive::step`], bridge |
//! | 3 | `serial` | moves bytes between port and frames |
//! | 2 | `serve` | carries out commands |
//! | 1 | `stream`, `keep` | sends telemetry, writes parameters to the flash |
//! | 0 | `idle` | sleeps; with the fast transport it moves the bytes |
//!
//! On the board the converter's interrupt starts `control` in the middle of the PWM period. In the emulator, which has
//! no converter, a frame with the same readings does: it is put into the mailbox, and the same interrupt is
//! pended. A higher task never waits for a lower one but for the few instructions of a lock on `drive` or `mailbox`.
//!
//! ```text
//!   USART or standard input ──bytes──▶ receiver ──┬─sample, set point─▶ mailbox ─▶ control
//!                                                 └─commands─▶ serve ─▶ outbox ──bytes──▶ back
//! ```
//!
//! [`Drive::step`]: bristle_core::drive::Drive::step
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(not(target_os = "none"))]
fn main() {}

#[cfg(all(target_os = "none", target_abi = "eabihf"))]
#[rtic::app(device = bristle_firmware::board::device, dispatchers = [SPI1, SPI2])]
mod app {
    use core::mem::MaybeUninit;

    use bristle_core::drive::signal::{Selection, Snapshot};
    use bristle_core::drive::{Drive, Mailbox};
    use bristle_core::link::{
        self, Answer, Counters, Frame, Hello, Injection, Packet, Reaction, Report,
    };
    use bristle_firmware::board::device::Interrupt;
    use bristle_firmware::board::emulated::{self, Persistent};
    use bristle_firmware::board::{BLOCK, Board, Hardware, Serial, Storage};
    use bristle_firmware::fault;
    use bristle_firmware::inlet;
    use bristle_firmware::log;
    use bristle_firmware::outbox::{Actuations, Outbox, Postbox, WAITING};
    use bristle_firmware::stack;
    use rtic_sync::channel::{Channel, Receiver, Sender};

    /// Commands that wait to be served.
    const BACKLOG: usize = 3;

    /// Words in the recording ring: 10 s of two signals at 1 kHz, and some.
    const RING: usize = 22_528;

    /// Telemetry that waits to be sent.
    const SNAPSHOTS: usize = 2;

    /// The number of a telemetry frame, the signals wanted, and all there are.
    type Due = (u16, Selection, Snapshot);

    /// What is left to the task that keeps things in order.
    pub enum Chore {
        /// Compare the parameters.
        Verify,
        /// Write them to the flash, for the packet of this number.
        Store(u16),
        /// Let the hardware fail, for the packet of this number.
        Inject(u16, Injection),
    }

    #[shared]
    struct Shared {
        drive: Drive<'static, f32>,
        mailbox: Mailbox<f32>,
        receiver: link::Receiver,
        outbox: Outbox,
    }

    #[local]
    struct Local {
        hardware: Hardware,
        port: Serial,
        due: Sender<'static, Due, SNAPSHOTS>,
        number: u16,
        watch: log::Watch,
        verify: Sender<'static, Chore, BACKLOG>,
        from_port: Sender<'static, Packet<f32>, BACKLOG>,
        from_input: Sender<'static, Packet<f32>, BACKLOG>,
        emulated: bool,
        fast: bool,
    }

    #[init(local = [
        // SAFETY: the section is memory like any other, but for not being initialised, which the type allows for.
        #[allow(unsafe_code)]
        #[unsafe(link_section = ".uninit.persistent")]
        persistent: MaybeUninit<Persistent> = MaybeUninit::uninit(),
        ring: [u32; RING] = [0; RING],
        telemetry: Channel<Due, SNAPSHOTS> = Channel::new(),
        inbound: Channel<Packet<f32>, BACKLOG> = Channel::new(),
        chores: Channel<Chore, BACKLOG> = Channel::new(),
        outbound: Channel<Frame, WAITING> = Channel::new(),
        actuations: Channel<Frame, 1> = Channel::new(),
    ])]
    fn init(cx: init::Context) -> (Shared, Local) {
        stack::paint();
        log::start();
        let (due, snapshots) = cx.local.telemetry.split();
        let (packet, packets) = cx.local.inbound.split();
        let (chore, chores) = cx.local.chores.split();
        let (frame, frames) = cx.local.outbound.split();
        let (place, actuated) = cx.local.actuations.split();
        let mut board = Board::start(cx.device, cx.core, cx.local.persistent);
        let notify = if board.fast { || () } else { wake_serial };
        let postbox = Postbox::new(frame, notify);
        let (parameters, faults) = board.storage.load(board.faults);
        let Some(drive) = Drive::new(parameters, faults, cx.local.ring) else {
            // What is loaded is valid.
            fault::stop(fault::PANIC_STATUS)
        };
        // None of these can fail: nothing has spawned the tasks before.
        let hello = board.hello(RING);
        let _ = serve::spawn(hello, packets, chore.clone(), postbox.another());
        let _ = stream::spawn(snapshots, postbox.another());
        let _ = keep::spawn(chores, board.storage, postbox);
        let emulated = board.hardware.is_none();
        log::started(emulated);
        let shared = Shared {
            drive,
            mailbox: Mailbox::new(),
            receiver: link::Receiver::new(),
            outbox: Outbox::new(actuated, frames),
        };
        let local = Local {
            hardware: match board.hardware {
                Some(power) => Hardware::OdriveV3(power),
                None => Hardware::Emulated(Actuations::new(place, notify)),
            },
            port: board.port,
            due,
            number: 0,
            watch: log::Watch::new(),
            verify: chore,
            from_port: packet.clone(),
            from_input: packet,
            emulated,
            fast: board.fast,
        };
        (shared, local)
    }

    fn wake_serial() {
        rtic::pend(Interrupt::UART4);
    }

    /// Sleeps. With the fast transport it moves the bytes, as no interrupt tells of standard input.
    #[idle(local = [fast, from_input], shared = [mailbox, receiver, outbox])]
    fn idle(mut cx: idle::Context) -> ! {
        let mut buffer = [0; BLOCK];
        loop {
            if !*cx.local.fast {
                rtic::export::wfi();
                continue;
            }
            while let Some(frame) = cx.shared.outbox.lock(Outbox::take_frame) {
                emulated::write(&frame);
            }
            let bytes = emulated::read(&mut buffer).iter().copied();
            let (receiver, mailbox) = (&mut cx.shared.receiver, &mut cx.shared.mailbox);
            inlet::take(bytes, receiver, mailbox, true, |packet| {
                cx.local.from_input.try_send(packet).is_ok()
            });
        }
    }

    /// Moves bytes between the port and the frames.
    #[task(binds = UART4, priority = 3, local = [port, from_port, emulated], shared = [mailbox, receiver, outbox])]
    fn serial(mut cx: serial::Context) {
        let port = cx.local.port;
        let bytes = core::iter::from_fn(|| port.read());
        let (receiver, mailbox) = (&mut cx.shared.receiver, &mut cx.shared.mailbox);
        inlet::take(bytes, receiver, mailbox, *cx.local.emulated, |packet| {
            cx.local.from_port.try_send(packet).is_ok()
        });
        cx.shared.outbox.lock(|outbox| {
            while port.can_write()
                && let Some(byte) = outbox.take_byte()
            {
                port.write(byte);
            }
            port.interrupt_when_writable(!outbox.is_empty());
        });
    }

    /// A control period.
    #[task(binds = ADC, priority = 5, local = [hardware, due, verify, number, watch], shared = [drive, mailbox])]
    fn control(cx: control::Context) {
        let (mut drive, mut mailbox) = (cx.shared.drive, cx.shared.mailbox);
        let hardware = cx.local.hardware;
        let (sample, news) = mailbox.lock(|mailbox| hardware.sample(mailbox));
        let Some(sample) = sample else { return };
        drive.lock(|drive| {
            let actuation = drive.step(&sample, &news);
            hardware.actuate(drive, &actuation);
            cx.local.watch.look(drive);
            if let Some(selection) = drive.due() {
                *cx.local.number = cx.local.number.wrapping_add(1);
                // A line that is busy shows as a gap in the numbers.
                let _ = cx
                    .local
                    .due
                    .try_send((*cx.local.number, selection, *drive.snapshot()));
            }
            if drive.is_to_be_verified() {
                // A chore that still waits does the same.
                let _ = cx.local.verify.try_send(Chore::Verify);
            }
        });
    }

    /// Carries out commands, after greeting the host.
    #[task(priority = 2, shared = [drive, receiver])]
    async fn serve(
        mut cx: serve::Context,
        hello: Hello,
        mut packets: Receiver<'static, Packet<f32>, BACKLOG>,
        mut chores: Sender<'static, Chore, BACKLOG>,
        mut postbox: Postbox,
    ) {
        postbox.send(&Report::<f32>::Hello(hello)).await;
        // The senders live in resources that are never dropped.
        while let Ok(Packet { sequence, command }) = packets.recv().await {
            let lost = cx.shared.receiver.lock(|receiver| receiver.counters());
            let counters = Counters {
                stack: stack::deepest(),
                ..lost
            };
            let reaction = cx
                .shared
                .drive
                .lock(|drive| link::serve(drive, counters, &command));
            let report = match reaction {
                Reaction::Answer(answer) => answered(sequence, answer),
                Reaction::Greet => Report::Hello(hello),
                Reaction::Store => {
                    let _ = chores.send(Chore::Store(sequence)).await;
                    continue;
                }
                Reaction::Inject(injection) => {
                    let _ = chores.send(Chore::Inject(sequence, injection)).await;
                    continue;
                }
            };
            postbox.send(&report).await;
        }
    }

    /// The answer to a packet; a refusal is logged.
    fn answered(to: u16, answer: Answer<f32>) -> Report<f32> {
        if let Answer::Refused(why) = answer {
            log::refused(to, why);
        }
        Report::Answer { to, answer }
    }

    /// Sends telemetry.
    #[task(priority = 1)]
    async fn stream(
        _: stream::Context,
        mut due: Receiver<'static, Due, SNAPSHOTS>,
        mut postbox: Postbox,
    ) {
        while let Ok((number, selection, snapshot)) = due.recv().await {
            let report = link::telemetry(number, selection, &snapshot);
            postbox.send(&report).await;
        }
    }

    /// Does what takes long: compares the parameters, and writes the flash.
    #[task(priority = 1, shared = [drive])]
    async fn keep(
        mut cx: keep::Context,
        mut chores: Receiver<'static, Chore, BACKLOG>,
        mut storage: Storage,
        mut postbox: Postbox,
    ) {
        while let Ok(chore) = chores.recv().await {
            let (to, answer) = match chore {
                Chore::Verify => {
                    cx.shared.drive.lock(Drive::verify);
                    continue;
                }
                Chore::Inject(to, injection) => {
                    let answer = storage.inject(injection);
                    if answer == Answer::Done {
                        cx.shared.drive.lock(|drive| link::suffer(drive, injection));
                    }
                    (to, answer)
                }
                Chore::Store(to) => {
                    let parameters = cx.shared.drive.lock(|drive| *drive.parameters());
                    let answer = storage.save(&parameters);
                    if answer == Answer::Done {
                        log::stored();
                    }
                    (to, answer)
                }
            };
            postbox.send(&answered(to, answer)).await;
        }
    }
}
