//! What waits for the control task: the latest sample and set point, and whether one came too early.

use super::{News, Sample};
use crate::control::SetPoint;

/// Written by the link, emptied by the control task.
#[derive(Clone, Copy, Debug)]
pub struct Mailbox<T> {
    sample: Option<Sample>,
    set_point: Option<SetPoint<T>>,
    heard: bool,
    missed: bool,
}

impl<T> Mailbox<T> {
    /// An empty mailbox.
    pub const fn new() -> Self {
        Self {
            sample: None,
            set_point: None,
            heard: false,
            missed: false,
        }
    }

    /// Leaves a sample. One that still lies there is a missed period.
    pub fn put_sample(&mut self, sample: Sample) {
        self.missed |= self.sample.replace(sample).is_some();
    }

    /// Leaves a set point in place of the one before.
    pub fn put_set_point(&mut self, set_point: SetPoint<T>) {
        self.set_point = Some(set_point);
        self.heard = true;
    }

    /// Notes that the host is alive.
    pub fn hear(&mut self) {
        self.heard = true;
    }

    /// Takes the sample.
    pub fn take_sample(&mut self) -> Option<Sample> {
        self.sample.take()
    }

    /// Takes what has come since the last time.
    pub fn take_news(&mut self) -> News<T> {
        News {
            set_point: self.set_point.take(),
            heard: core::mem::take(&mut self.heard),
            missed: core::mem::take(&mut self.missed),
        }
    }
}

impl<T> Default for Mailbox<T> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::Mailbox;
    use crate::control::SetPoint;
    use crate::drive::{News, Sample};

    #[test]
    fn news_is_told_once_and_a_sample_nobody_took_is_a_missed_period() {
        let mut mailbox = Mailbox::<f32>::new();
        mailbox.put_sample(Sample::default());
        mailbox.put_set_point(SetPoint::Command(1.0));
        mailbox.put_set_point(SetPoint::Command(2.0));
        assert_eq!(mailbox.take_sample(), Some(Sample::default()));
        let news = News {
            set_point: Some(SetPoint::Command(2.0)),
            heard: true,
            missed: false,
        };
        assert_eq!(mailbox.take_news(), news);
        assert_eq!(mailbox.take_sample(), None);
        assert_eq!(mailbox.take_news(), News::NONE);
        mailbox.put_sample(Sample::default());
        mailbox.put_sample(Sample::default());
        assert!(mailbox.take_news().missed);
    }
}
