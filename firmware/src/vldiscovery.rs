//! The control path in fixed point, on a chip without a floating-point unit and with 8 KB of RAM; in the emulator only.
//!
//! | priority | task | what it does |
//! | --- | --- | --- |
//! | 3 | `control` | a control period: sample, `Drive::step`, actuation |
//! | 2 | `serial` | moves bytes between port and frames |
//! | 0 | `idle` | commands, telemetry, parameters, one after the other; with the fast transport it moves the bytes; sleeps |
//!
//! The same path from a byte to an actuation as in `main.rs`, with one room for each kind of thing that waits, as the host
//! asks one thing at a time. There is no recording ring.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(not(target_os = "none"))]
fn main() {}

#[cfg(all(target_os = "none", not(target_abi = "eabihf")))]
#[rtic::app(device = bristle_firmware::board::device)]
mod app {
    use core::mem::MaybeUninit;

    use bristle_core::drive::signal::{Selection, Snapshot};
    use bristle_core::drive::{Drive, Mailbox, store};
    use bristle_core::link::{self, Answer, Counters, Hello, Packet, Reaction, Report, encode};
    use bristle_core::scalar::Q16;
    use bristle_firmware::board::device::Interrupt;
    use bristle_firmware::board::emulated::{self, Flash, PLACES, Persistent};
    use bristle_firmware::board::{self, BLOCK, Board, Serial};
    use bristle_firmware::fault;
    use bristle_firmware::inlet;
    use bristle_firmware::line::Line;
    use bristle_firmware::log;
    use bristle_firmware::stack;
    use rtic::Mutex;

    /// What waits for `idle`.
    pub struct Waiting {
        packet: Option<Packet<Q16>>,
        /// The number of a telemetry frame, the signals wanted, and all there are.
        telemetry: Option<(u16, Selection, Snapshot)>,
        verify: bool,
    }

    #[shared]
    struct Shared {
        drive: Drive<'static, Q16>,
        mailbox: Mailbox<Q16>,
        receiver: link::Receiver,
        waiting: Waiting,
        line: Line,
        fast: bool,
        /// Made once, as it takes the checksum of the whole image.
        hello: Hello,
    }

    #[local]
    struct Local {
        port: Serial,
        flash: Flash,
        number: u16,
        watch: log::Watch,
    }

    #[init(local = [
        // SAFETY: the section is memory like any other, but for not being initialised, which the type allows for.
        #[allow(unsafe_code)]
        #[unsafe(link_section = ".uninit.persistent")]
        persistent: MaybeUninit<Persistent> = MaybeUninit::uninit(),
    ])]
    fn init(cx: init::Context) -> (Shared, Local) {
        stack::paint();
        log::start();
        log::started(true);
        let mut board = Board::start(cx.device, cx.local.persistent);
        let (parameters, faults) = store::boot(&mut board.flash, PLACES, board.faults);
        let Some(drive) = Drive::new(parameters, faults, &mut []) else {
            // What is loaded is valid.
            fault::stop(fault::PANIC_STATUS)
        };
        let shared = Shared {
            drive,
            mailbox: Mailbox::new(),
            receiver: link::Receiver::new(),
            waiting: Waiting {
                packet: None,
                telemetry: None,
                verify: false,
            },
            line: Line::new(),
            fast: board.fast,
            hello: board::hello(),
        };
        let local = Local {
            port: board.port,
            flash: board.flash,
            number: 0,
            watch: log::Watch::new(),
        };
        (shared, local)
    }

    /// Does what is left, and then waits for more.
    #[idle(local = [flash], shared = [drive, mailbox, receiver, waiting, line, &fast, &hello])]
    fn idle(mut cx: idle::Context) -> ! {
        let shared = &mut cx.shared;
        send(&mut shared.line, &Report::Hello(*shared.hello));
        wake(*shared.fast);
        loop {
            if *shared.fast {
                flush(&mut shared.line);
            }
            if shared.line.lock(|line| line.has_room()) && work(shared, cx.local.flash) {
                wake(*shared.fast);
            } else if *shared.fast {
                read(shared);
            } else {
                sleep(&mut shared.waiting);
            }
        }
    }

    /// Waits for an interrupt, unless something came in the meantime.
    fn sleep(waiting: &mut impl Mutex<T = Waiting>) {
        cortex_m::interrupt::free(|_| {
            // With interrupts masked, one that comes now still ends the sleep.
            if waiting.lock(|w| w.packet.is_none() && w.telemetry.is_none() && !w.verify) {
                cortex_m::asm::wfi();
            }
        });
    }

    /// Takes what the host sends to the emulator's standard input.
    #[inline(never)]
    fn read(shared: &mut idle::SharedResources) {
        let mut buffer = [0; BLOCK];
        let bytes = emulated::read(&mut buffer).iter().copied();
        let (receiver, mailbox) = (&mut shared.receiver, &mut shared.mailbox);
        inlet::take(bytes, receiver, mailbox, true, |packet| {
            shared.waiting.lock(|waiting| keep(waiting, packet))
        });
    }

    /// Writes all that waits to the emulator's standard output.
    fn flush(line: &mut impl Mutex<T = Line>) {
        while line.lock(|line| {
            let rest = line.rest();
            emulated::write(rest);
            let length = rest.len();
            line.sent(length);
            length > 0
        }) {}
    }

    /// Room for one packet; whether it was free.
    fn keep(waiting: &mut Waiting, packet: Packet<Q16>) -> bool {
        let free = waiting.packet.is_none();
        if free {
            waiting.packet = Some(packet);
        }
        free
    }

    /// Does one thing that waits; whether there was one.
    ///
    /// The receiver is locked meanwhile, and with it the port's interrupt: the stack has no room for a command that is carried
    /// out and another that is taken in. The control task goes on.
    #[inline(never)]
    fn work(shared: &mut idle::SharedResources, flash: &mut Flash) -> bool {
        let (drive, waiting, line) = (&mut shared.drive, &mut shared.waiting, &mut shared.line);
        let hello = shared.hello;
        shared.receiver.lock(|receiver| {
            if waiting.lock(|waiting| core::mem::take(&mut waiting.verify)) {
                drive.lock(Drive::verify);
                return true;
            }
            stream(waiting, line)
                || serve(drive, waiting, line, (receiver.counters(), hello), flash)
        })
    }

    // These have their room on the stack one after the other, and not all at once.

    /// Sends telemetry; whether some was due.
    #[inline(never)]
    fn stream(waiting: &mut impl Mutex<T = Waiting>, line: &mut impl Mutex<T = Line>) -> bool {
        let due = waiting.lock(|waiting| waiting.telemetry.take());
        let Some((number, selection, snapshot)) = due else {
            return false;
        };
        send(line, &link::telemetry(number, selection, &snapshot));
        true
    }

    /// Carries out a command; whether there was one.
    #[inline(never)]
    fn serve(
        drive: &mut impl Mutex<T = Drive<'static, Q16>>,
        waiting: &mut impl Mutex<T = Waiting>,
        line: &mut impl Mutex<T = Line>,
        (lost, hello): (Counters, &Hello),
        flash: &mut Flash,
    ) -> bool {
        let packet = waiting.lock(|waiting| waiting.packet.take());
        let Some(Packet { sequence, command }) = packet else {
            return false;
        };
        let counters = Counters {
            stack: stack::deepest(),
            ..lost
        };
        let answer = match drive.lock(|drive| link::serve(drive, counters, &command)) {
            Reaction::Greet => {
                send(line, &Report::Hello(*hello));
                return true;
            }
            Reaction::Answer(answer) => answer,
            Reaction::Store => {
                let parameters = drive.lock(|drive| *drive.parameters());
                let answer = link::store(flash, PLACES, &parameters);
                if answer == Answer::Done {
                    log::stored();
                }
                answer
            }
            Reaction::Inject(injection) => {
                flash.inject(injection);
                drive.lock(|drive| link::suffer(drive, injection));
                Answer::Done
            }
        };
        if let Answer::Refused(why) = answer {
            log::refused(sequence, why);
        }
        let to = sequence;
        send(line, &Report::Answer { to, answer });
        true
    }

    /// Leaves a report to be sent; there is room.
    #[inline(never)]
    fn send(line: &mut impl Mutex<T = Line>, report: &Report<Q16>) {
        // Every report fits a frame, which a test of `link` holds.
        if let Ok(frame) = encode(report) {
            line.lock(|line| line.put(frame));
        }
    }

    /// Moves bytes between the port and the frames.
    #[task(binds = USART1, priority = 2, local = [port], shared = [mailbox, receiver, waiting, line])]
    fn serial(mut cx: serial::Context) {
        let port = cx.local.port;
        let bytes = core::iter::from_fn(|| port.read());
        let (receiver, mailbox) = (&mut cx.shared.receiver, &mut cx.shared.mailbox);
        inlet::take(bytes, receiver, mailbox, true, |packet| {
            cx.shared.waiting.lock(|waiting| keep(waiting, packet))
        });
        cx.shared.line.lock(|line| {
            while port.can_write()
                && let Some(&byte) = line.rest().first()
            {
                port.write(byte);
                line.sent(1);
            }
            port.interrupt_when_writable(!line.is_empty());
        });
    }

    /// A control period.
    #[task(binds = ADC, priority = 3, local = [number, watch], shared = [drive, mailbox, waiting, line, &fast])]
    fn control(cx: control::Context) {
        let (mut drive, mut mailbox) = (cx.shared.drive, cx.shared.mailbox);
        let (mut waiting, mut line) = (cx.shared.waiting, cx.shared.line);
        let (sample, news) = mailbox.lock(|mailbox| (mailbox.take_sample(), mailbox.take_news()));
        let Some(sample) = sample else { return };
        drive.lock(|drive| {
            let actuation = drive.step(&sample, &news);
            let report = link::actuation(drive, &actuation);
            line.lock(|line| line.actuate(&report));
            cx.local.watch.look(drive);
            waiting.lock(|waiting| {
                if let Some(selection) = drive.due() {
                    *cx.local.number = cx.local.number.wrapping_add(1);
                    // A line that is busy shows as a gap in the numbers.
                    let due = (*cx.local.number, selection, *drive.snapshot());
                    waiting.telemetry.get_or_insert(due);
                }
                waiting.verify |= drive.is_to_be_verified();
            });
        });
        wake(*cx.shared.fast);
    }

    /// Something is to be sent. The fast transport is `idle`'s, which sees by itself.
    fn wake(fast: bool) {
        if !fast {
            rtic::pend(Interrupt::USART1);
        }
    }
}
