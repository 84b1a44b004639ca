//! One pass over all recordings: a thread reads, others work, and the shares add up in the order of the pieces.

use std::collections::BTreeMap;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread;

use super::Progress;
use super::cut::{Cutter, Piece, Sizes};
use super::pilot::Plan;
use super::work::{Share, share};
use crate::error::{Error, Result};
use crate::fit::Sums;
use crate::model::Model;
use crate::normal::Normal;
use crate::recording::Long;
use crate::refine::free_parameters;

/// Threads that work, at most: each holds a piece.
const WORKERS: usize = 4;

/// Sums the shares of all pieces at the present values of a model.
pub(super) fn run(
    recordings: &[Long],
    plan: &Plan,
    model: &Model,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Share> {
    let (pieces, queue) = sync_channel(1);
    // Shared by the workers alone: when the last of them stops, the reader notices.
    let queue = Arc::new(Mutex::new(queue));
    let (done, shares) = channel();
    thread::scope(|scope| {
        let reader = scope.spawn(move || read(recordings, plan, &pieces));
        let workers = thread::available_parallelism().map_or(1, usize::from);
        for _ in 0..workers.min(WORKERS) {
            let (queue, done) = (Arc::clone(&queue), done.clone());
            scope.spawn(move || work(&queue, &done, plan, model));
        }
        drop((queue, done));
        let total = add_up(shares, free_parameters(model).len(), progress);
        let read = reader.join().unwrap_or_else(|_| {
            Err(Error::Internal(
                "the reading of recordings stopped".to_owned(),
            ))
        });
        read.and(total)
    })
}

/// Sends numbered pieces until the recordings end or nobody takes them.
fn read(recordings: &[Long], plan: &Plan, pieces: &SyncSender<(usize, Piece)>) -> Result<()> {
    let mut number = 0;
    for long in recordings {
        let mut cutter = Cutter::new(long, Sizes::new(long, plan.half_width))?;
        while let Some(piece) = cutter.next()? {
            if pieces.send((number, piece)).is_err() {
                return Ok(());
            }
            number += 1;
        }
    }
    Ok(())
}

/// The number of a piece, its samples and its share.
type Done = (usize, usize, Result<Share>);

fn work(queue: &Mutex<Receiver<(usize, Piece)>>, done: &Sender<Done>, plan: &Plan, model: &Model) {
    loop {
        let next = queue.lock().map(|queue| queue.recv());
        let Ok(Ok((number, piece))) = next else {
            return;
        };
        let share = share(&piece, plan, model);
        if done.send((number, piece.core.len(), share)).is_err() {
            return;
        }
    }
}

/// Adds shares in the order of their pieces, so that the sums do not depend on who was first.
fn add_up(
    shares: Receiver<Done>,
    free: usize,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Share> {
    let mut total = (Normal::zero(free), [Sums::default(); 2]);
    let mut early = BTreeMap::new();
    let mut next = 0;
    for (number, samples, share) in shares {
        early.insert(number, share?);
        while let Some((normal, sums)) = early.remove(&next) {
            total.0.add(&normal);
            total.1.iter_mut().zip(&sums).for_each(|(a, b)| a.add(b));
            next += 1;
        }
        progress(Progress::Samples(samples));
    }
    Ok(total)
}
