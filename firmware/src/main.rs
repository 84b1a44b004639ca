//! Bristle's friction laws on the board, evaluated for the host over the serial link.
//!
//! Two tasks. `serial` is the interrupt of the port: it moves bytes, cuts them into frames and does nothing else, so
//! that no byte is lost while a law is evaluated. `serve` is a software task of lower priority that answers
//! frames one by one. Two channels of frames join them:
//!
//! ```text
//!   USART1 ──bytes──▶ serial ──inbound──▶ serve ──outbound──▶ serial ──bytes──▶ USART1
//! ```
//!
//! `serial` never waits: a frame that finds its channel full is dropped and counted. `serve` waits for room in
//! `outbound`, so a host that sends faster than it reads slows itself down.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(not(target_os = "none"))]
fn main() {}

#[cfg(target_os = "none")]
#[rtic::app(device = bristle_firmware::board::device, dispatchers = [SPI1])]
mod app {
    use bristle_core::link::{Deframer, Frame, Rejection, Server, encode};
    use bristle_firmware::board::{Serial, device::Interrupt};
    use bristle_firmware::outbox::{Outbox, WAITING};
    use rtic_sync::channel::{Channel, Receiver, Sender};

    /// What `serial` passes on: a frame, or why there is none.
    type Received = Result<Frame, Rejection>;

    /// The most frames that wait to be served: one being received while one is served, twice.
    const BACKLOG: usize = 4;

    #[shared]
    struct Shared {
        /// Frames dropped since `serve` last looked.
        dropped: u32,
    }

    #[local]
    struct Local {
        port: Serial,
        deframer: Deframer,
        outbox: Outbox,
        received: Sender<'static, Received, BACKLOG>,
    }

    #[init(local = [
        inbound: Channel<Received, BACKLOG> = Channel::new(),
        outbound: Channel<Frame, WAITING> = Channel::new(),
    ])]
    fn init(cx: init::Context) -> (Shared, Local) {
        let (received, requests) = cx.local.inbound.split();
        let (responses, outgoing) = cx.local.outbound.split();
        // The receiver is on before `serve` says hello: whoever has seen the hello is heard.
        let port = Serial::new(cx.device.USART1, &cx.device.GPIOA, &cx.device.RCC);
        // Cannot fail: nothing has spawned this task before.
        let _ = serve::spawn(requests, responses);
        (
            Shared { dropped: 0 },
            Local {
                port,
                deframer: Deframer::new(),
                outbox: Outbox::new(outgoing),
                received,
            },
        )
    }

    #[idle]
    fn idle(_: idle::Context) -> ! {
        loop {
            rtic::export::wfi();
        }
    }

    /// Moves bytes between the port and the channels.
    #[task(binds = USART1, priority = 2, local = [port, deframer, outbox, received], shared = [dropped])]
    fn serial(mut cx: serial::Context) {
        let port = cx.local.port;
        while let Some(byte) = port.read() {
            if let Some(frame) = cx.local.deframer.push(byte)
                && cx.local.received.try_send(frame).is_err()
            {
                cx.shared.dropped.lock(|n| *n = n.saturating_add(1));
            }
        }
        while port.can_write()
            && let Some(byte) = cx.local.outbox.take_byte()
        {
            port.write(byte);
        }
        port.interrupt_when_writable(!cx.local.outbox.is_empty());
    }

    /// Answers frames, after greeting the host.
    #[task(priority = 1, shared = [dropped])]
    async fn serve(
        mut cx: serve::Context,
        mut requests: Receiver<'static, Received, BACKLOG>,
        mut responses: Sender<'static, Frame, WAITING>,
    ) {
        let mut server = Server::new();
        let mut response = Server::hello();
        loop {
            // Every response fits a frame, which a test of `link` holds; and the outbox is never dropped. Were either to
            // change, the host would miss one answer and the board would go on listening.
            if let Ok(frame) = encode(&response) {
                let _ = responses.send(frame).await;
                rtic::pend(Interrupt::USART1);
            }
            // A drop implies a full backlog, so this is looked at once more after it.
            response = match cx.shared.dropped.lock(core::mem::take) {
                0 => match requests.recv().await {
                    Ok(received) => server.answer(received),
                    // The sender lives in a resource that is never dropped.
                    Err(_) => return,
                },
                frames => server.overrun(frames),
            };
        }
    }
}
