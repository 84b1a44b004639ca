//! An emulated board with its axis that goes on by itself, in real time, as a board on a serial port does.
//!
//! A thread keeps board and plant in lockstep and lets the periods pass at their rate. What the program sends is put
//! between the samples, and what the board sends comes back without what it does with its bridge, so that whoever holds
//! this [`Wire`] cannot tell it from a port. The plant remembers all its inputs, as some effects reach back: 60 MB an hour
//! at 1 kHz.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError, channel};
use std::thread::{JoinHandle, sleep};
use std::time::{Duration, Instant};

use bristle_core::drive::Parameters;
use bristle_core::link::{Command, Deframer, Injection, Packet, Report, decode, encode};

use super::Sensors;
use crate::error::{Error, Result};
use crate::link::{BLOCK, Peer, Wire};
use crate::model::Model;
use crate::plant;

/// The axis, and what the board is told of it.
#[derive(Clone)]
pub struct Axis {
    /// The axis as it is.
    pub model: Model,
    /// Its converters.
    pub sensors: Sensors,
    /// What the board is set up with before anybody is let near it.
    pub parameters: Parameters<f32>,
}

/// As a serial port waits while a board is looked for.
const LOOKING: Duration = Duration::from_millis(400);

/// A running board, ended when dropped.
pub struct Live {
    name: String,
    to_board: Option<Sender<Vec<u8>>>,
    from_board: Receiver<Result<Vec<u8>>>,
    rest: VecDeque<u8>,
    patience: Duration,
    thread: Option<JoinHandle<()>>,
}

impl Live {
    /// Sets up a board that has greeted, and lets time pass for it.
    pub fn start<W: Wire + Send + 'static>(mut board: Peer<f32, W>, axis: Axis) -> Result<Self> {
        board.tell(Command::Set(axis.parameters))?;
        let name = board.wire().name().to_owned();
        let (to_board, inbox) = channel();
        let (out, from_board) = channel();
        let mut relay = Relay {
            board,
            inlet: Deframer::new(),
            asked: VecDeque::new(),
            inbox,
            out,
        };
        let thread = std::thread::spawn(move || {
            if let Err(e) = relay.go_on(&axis) {
                // Fails only if nobody listens any more.
                let _ = relay.out.send(Err(e));
            }
        });
        Ok(Self {
            name,
            to_board: Some(to_board),
            from_board,
            rest: VecDeque::new(),
            patience: LOOKING,
            thread: Some(thread),
        })
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        // The thread ends when nobody can send to it any more.
        self.to_board = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn ended() -> Error {
    Error::Board("the emulated one has ended".to_owned())
}

impl Wire for Live {
    fn is_noisy(&self) -> bool {
        false
    }

    fn set_patience(&mut self, patience: Duration) -> Result<()> {
        self.patience = patience;
        Ok(())
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        let sent = self.to_board.as_ref().map(|to| to.send(bytes.to_vec()));
        match sent {
            Some(Ok(())) => Ok(()),
            // Why it ended is what `read` says.
            _ => Err(ended()),
        }
    }

    fn read(&mut self, buffer: &mut [u8; BLOCK]) -> Result<usize> {
        if self.rest.is_empty() {
            match self.from_board.recv_timeout(self.patience) {
                Ok(bytes) => self.rest.extend(bytes?),
                Err(RecvTimeoutError::Timeout) => return Ok(0),
                Err(RecvTimeoutError::Disconnected) => return Err(ended()),
            }
            while self.rest.len() < BLOCK
                && let Ok(bytes) = self.from_board.try_recv()
            {
                self.rest.extend(bytes?);
            }
        }
        let length = self.rest.len().min(BLOCK);
        for (to, from) in buffer.iter_mut().zip(self.rest.drain(..length)) {
            *to = from;
        }
        Ok(length)
    }

    fn name(&self) -> &str {
        &self.name
    }
}

/// Between the program, the board and the plant.
struct Relay<W> {
    board: Peer<f32, W>,
    inlet: Deframer,
    /// Numbers of commands on the way to the board, each with the one that the program gave it.
    asked: VecDeque<(u16, u16)>,
    inbox: Receiver<Vec<u8>>,
    out: Sender<Result<Vec<u8>>>,
}

impl<W: Wire> Relay<W> {
    /// Lets periods pass until the program's end is dropped.
    fn go_on(&mut self, axis: &Axis) -> Result<()> {
        let mut plant = plant::new(&axis.model)?;
        let seconds = f64::from(axis.parameters.control.period);
        let mut pace = Pace::new(Duration::from_secs_f64(seconds));
        let (mut t, mut u) = (vec![0.0], Vec::new());
        for k in 0.. {
            loop {
                match self.inbox.try_recv() {
                    Ok(bytes) => self.pass_on(&bytes)?,
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Disconnected) => return Ok(()),
                }
            }
            let q = plant.measured().q;
            let sample = axis.sensors.sample(q, plant.current().unwrap_or(0.0));
            self.board.send(Command::Sample(sample))?;
            u.push(self.actuation()?.into());
            t.push((k + 1) as f64 * seconds);
            plant.advance(&t, &u, k, 0.0);
            pace.wait();
        }
        Ok(())
    }

    /// Sends the program's commands, under the numbers that the board expects.
    fn pass_on(&mut self, bytes: &[u8]) -> Result<()> {
        for &byte in bytes {
            // What the program garbles is not sent; it is told by having no answer, as on a port.
            let Some(Ok(packet)) = self.inlet.push(byte).map(|frame| frame.and_then(decode)) else {
                continue;
            };
            let Packet { sequence, command } = packet;
            let restarts = matches!(
                command,
                Command::Inject(Injection::Restart | Injection::Hang)
            );
            if !matches!(command, Command::Sample(_)) {
                let number = self.board.send(command)?;
                self.asked.push_back((number, sequence));
            }
            if restarts {
                // A sample that comes before it listens again would be lost, and its answer waited for.
                let hello = self.board.greet()?;
                self.hand_out(&Report::Hello(hello))?;
            }
        }
        Ok(())
    }

    /// What the board does with the sample that was sent; everything else that it has to say goes to the program.
    fn actuation(&mut self) -> Result<f32> {
        let input = loop {
            match self.board.receive()? {
                Report::Actuation { input, .. } => break input,
                Report::Answer { to, answer } => {
                    if let Some(to) = self.asked_as(to) {
                        self.hand_out(&Report::Answer { to, answer })?;
                    }
                }
                other => self.hand_out(&other)?,
            }
        };
        for frame in self.board.take_telemetry().0 {
            self.hand_out(&Report::Telemetry {
                number: frame.number,
                period: frame.period,
                words: frame.words.into_iter().collect(),
            })?;
        }
        Ok(input)
    }

    /// The number that the program knows a command by. The ones before it will not be answered any more.
    fn asked_as(&mut self, number: u16) -> Option<u16> {
        let at = self.asked.iter().position(|(board, _)| *board == number)?;
        self.asked
            .drain(..=at)
            .next_back()
            .map(|(_, program)| program)
    }

    fn hand_out(&mut self, report: &Report<f32>) -> Result<()> {
        let frame = encode(report);
        let frame = frame.map_err(|e| Error::Internal(format!("a report has no frame: {e:?}")))?;
        // Fails only if nobody listens any more, which ends the thread in a moment.
        let _ = self.out.send(Ok(frame.to_vec()));
        Ok(())
    }
}

/// Real time, period by period.
struct Pace {
    due: Instant,
    period: Duration,
}

/// A machine that was busy for so long is not chased after: the axis has stood still meanwhile.
const BEHIND: Duration = Duration::from_millis(50);
/// Less is not worth a sleep.
const GRAIN: Duration = Duration::from_micros(500);

impl Pace {
    fn new(period: Duration) -> Self {
        Self {
            due: Instant::now(),
            period,
        }
    }

    fn wait(&mut self) {
        self.due += self.period;
        let now = Instant::now();
        if now > self.due + BEHIND {
            self.due = now;
        }
        if self.due > now + GRAIN {
            sleep(self.due - now);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use bristle_core::control::SetPoint;
    use bristle_core::drive::signal::{Selection, Signal};
    use bristle_core::drive::{Parameters, State};
    use bristle_core::link::{Answer, Command};

    use super::{Axis, Live};
    use crate::emulate::{Sensors, Setup, Twin, parameters};
    use crate::link::{Peer, Wire};
    use crate::model::Model;
    use crate::tune::Wish;

    const MODEL: &str = "[plant]\nmotion = \"rotary\"\ninput = \"torque\"\ninertia = 0.012\n\
        [friction]\ncoulomb = 0.1\nviscous = 0.02\n";

    fn axis() -> Axis {
        let model = Model::parse(MODEL).unwrap();
        let sensors = Sensors::emulated(std::f64::consts::TAU / 16384.0);
        let wish = Wish {
            bandwidth: 6.0,
            rate: 1000.0,
            counts: 16384.0,
            limit: 1.5,
            current: None,
        };
        let setup = Setup {
            wish,
            compensate: true,
        };
        let mut parameters: Parameters<f32> = parameters(&model, &setup, &sensors).unwrap();
        // A busy machine may stop the test for longer than a board waits for set points.
        parameters.limits.command_timeout = 0;
        parameters.limits.link_timeout = 0;
        Axis {
            model,
            sensors,
            parameters,
        }
    }

    #[test]
    fn it_looks_like_a_board_on_a_port_and_moves_by_itself() {
        let axis = axis();
        let board = Peer::called(Twin::new().unwrap()).unwrap();
        let live = Live::start(board, axis.clone()).unwrap();
        let mut board = Peer::<f32, _>::called(live).unwrap();
        let Answer::Parameters(held) = board.ask(Command::Get).unwrap() else {
            panic!("no parameters");
        };
        assert_eq!(held, axis.parameters);
        let selection = Selection::of(&[Signal::Velocity]);
        board
            .tell(Command::Telemetry {
                selection,
                every: 1,
            })
            .unwrap();
        board.tell(Command::Enable).unwrap();
        board.wire().set_patience(Duration::from_millis(5)).unwrap();
        let begun = Instant::now();
        let mut fastest = 0.0_f32;
        let mut frames = Vec::new();
        let [least, most] = [400, 20_000].map(Duration::from_millis);
        while begun.elapsed() < least || fastest <= 1.0 && begun.elapsed() < most {
            board
                .send(Command::SetPoint(SetPoint::Velocity {
                    velocity: 2.0,
                    acceleration: 0.0,
                }))
                .unwrap();
            board.poll().unwrap();
            let (more, lost) = board.take_telemetry();
            assert_eq!(lost, 0);
            for frame in more {
                fastest = fastest.max(f32::from_bits(frame.words[0]));
                frames.push(frame.period);
            }
        }
        assert!(fastest > 1.0, "{fastest}");
        assert!(frames.windows(2).all(|pair| pair[1] == pair[0] + 1));
        board.wire().set_patience(Duration::from_secs(1)).unwrap();
        board.tell(Command::Disable).unwrap();
        let status = board.ask(Command::Status).unwrap();
        assert!(matches!(
            status,
            Answer::Status {
                state: State::Off,
                ..
            }
        ));
    }
}
