//! The board's side of the conversation, without the hardware: what ships is what the host tests.

use super::{CHUNK, Frame, Law, PROTOCOL_VERSION, Rejection, Request, Response, Samples, decode};
use crate::friction::Friction;

/// Answers requests. Its only state is the law in force and the number of refusals.
#[derive(Debug, Default)]
pub struct Server {
    law: Option<Law>,
    rejected: u32,
}

impl Server {
    /// A server without a law.
    pub const fn new() -> Self {
        Self {
            law: None,
            rejected: 0,
        }
    }

    /// The greeting, sent unasked at boot.
    pub const fn hello() -> Response {
        Response::Hello {
            version: PROTOCOL_VERSION,
            chunk: CHUNK as u16,
        }
    }

    /// Answers one frame, or the failure to receive one.
    pub fn answer(&mut self, received: Result<Frame, Rejection>) -> Response {
        received
            .and_then(decode)
            .and_then(|request| self.serve(request))
            .unwrap_or_else(|reason| self.refuse(reason, 1))
    }

    /// Accounts for `frames` that had to be dropped before they could be served.
    pub fn overrun(&mut self, frames: u32) -> Response {
        self.refuse(Rejection::Overrun, frames)
    }

    fn serve(&mut self, request: Request) -> Result<Response, Rejection> {
        match request {
            Request::Hello => Ok(Self::hello()),
            Request::SetLaw(law) if law.is_valid() => {
                self.law = Some(law);
                Ok(Response::LawSet)
            }
            Request::SetLaw(_) => Err(Rejection::InvalidLaw),
            Request::Evaluate {
                sequence,
                velocities,
            } => {
                let law = self.law.ok_or(Rejection::NoLaw)?;
                let forces = evaluate(law, velocities)?;
                Ok(Response::Forces { sequence, forces })
            }
        }
    }

    fn refuse(&mut self, reason: Rejection, frames: u32) -> Response {
        self.rejected = self.rejected.saturating_add(frames);
        Response::Rejected {
            reason,
            total: self.rejected,
        }
    }
}

/// Replaces each velocity by the friction at it: in place, so that one buffer serves both.
fn evaluate(law: Law, mut samples: Samples) -> Result<Samples, Rejection> {
    for sample in &mut samples {
        if !sample.is_finite() {
            return Err(Rejection::NotFinite);
        }
        *sample = law.sliding(*sample);
    }
    Ok(samples)
}

#[cfg(test)]
mod tests {
    use super::Server;
    use crate::friction::{CoulombViscous, Curve, Friction, Stribeck};
    use crate::link::{Frame, Law, Rejection, Request, Response, Samples, encode};

    const FRICTION: CoulombViscous<f32> = CoulombViscous {
        coulomb: 0.2,
        viscous: 0.01,
    };
    const LAW: Law = Law::CoulombViscous(FRICTION);

    fn ask(server: &mut Server, request: &Request) -> Response {
        let mut frame = encode(request).unwrap();
        frame.pop(); // the delimiter
        server.answer(Ok(frame))
    }

    fn evaluate(velocities: &[f32]) -> Request {
        Request::Evaluate {
            sequence: 7,
            velocities: Samples::from_slice(velocities).unwrap(),
        }
    }

    #[test]
    fn forces_are_those_of_the_law_in_force() {
        let mut server = Server::new();
        assert_eq!(ask(&mut server, &Request::SetLaw(LAW)), Response::LawSet);
        let velocities = [-3.0, -0.0, 0.0, 1e-30, 42.0];
        let expected = Response::Forces {
            sequence: 7,
            forces: velocities.iter().map(|&v| FRICTION.sliding(v)).collect(),
        };
        assert_eq!(ask(&mut server, &evaluate(&velocities)), expected);
    }

    #[test]
    fn refusals_name_their_reason_and_are_counted() {
        let mut server = Server::new();
        let invalid = Law::Stribeck(Stribeck {
            coulomb: 0.2,
            viscous: 0.0,
            static_level: 0.1, // below the Coulomb level
            stribeck_velocity: 0.1,
            curve: Curve::Exponential,
        });
        let rejected = |reason, total| Response::Rejected { reason, total };
        let answer = ask(&mut server, &evaluate(&[1.0]));
        assert_eq!(answer, rejected(Rejection::NoLaw, 1));
        let answer = ask(&mut server, &Request::SetLaw(invalid));
        assert_eq!(answer, rejected(Rejection::InvalidLaw, 2));
        let answer = server.answer(Ok(Frame::from_slice(b"garbage").unwrap()));
        assert_eq!(answer, rejected(Rejection::Corrupt, 3));
        let answer = server.answer(Err(Rejection::TooLong));
        assert_eq!(answer, rejected(Rejection::TooLong, 4));
        assert_eq!(server.overrun(3), rejected(Rejection::Overrun, 7));

        assert_eq!(ask(&mut server, &Request::SetLaw(LAW)), Response::LawSet);
        let answer = ask(&mut server, &evaluate(&[1.0, f32::NAN]));
        assert_eq!(answer, rejected(Rejection::NotFinite, 8));
    }

    #[test]
    fn a_refused_law_leaves_the_old_one_in_force() {
        let mut server = Server::new();
        ask(&mut server, &Request::SetLaw(LAW));
        let before = ask(&mut server, &evaluate(&[1.0]));
        let invalid = Law::CoulombViscous(CoulombViscous {
            coulomb: -1.0,
            ..FRICTION
        });
        ask(&mut server, &Request::SetLaw(invalid));
        assert_eq!(ask(&mut server, &evaluate(&[1.0])), before);
    }
}
