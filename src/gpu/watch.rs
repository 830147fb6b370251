//! What the device or its driver works on, for somebody who waits: nobody else can say what takes so long.

use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::thread;
use std::time::{Duration, Instant};

use super::{Gpu, GpuError};

/// How long nothing is said.
const QUIET: Duration = Duration::from_secs(10);
/// How often the watch is looked at.
const PERIOD: Duration = Duration::from_millis(500);

/// Something that is waited for.
#[derive(Clone, Debug)]
pub struct Waiting {
    /// A step or a kernel by name, and the chain that it is of.
    pub what: String,
    pub waited: Duration,
    /// It has taken longer than it may. Neither a device nor a driver can be interrupted: who is told has to end the process.
    pub is_over: bool,
}

#[derive(Debug, Default)]
pub(super) struct Watch {
    now: Mutex<Option<Work>>,
}

#[derive(Debug)]
struct Work {
    what: String,
    since: Instant,
    is_told: bool,
}

impl Watch {
    fn set(&self, work: Option<Work>) {
        *self.now.lock().unwrap_or_else(PoisonError::into_inner) = work;
    }

    /// What there is to tell.
    fn look(&self, limit: Duration) -> Option<Waiting> {
        let mut now = self.now.lock().unwrap_or_else(PoisonError::into_inner);
        let work = now.as_mut()?;
        let waited = work.since.elapsed();
        let is_over = waited >= limit;
        let is_new = waited >= QUIET && !std::mem::replace(&mut work.is_told, waited >= QUIET);
        (is_new || is_over).then(|| Waiting { what: work.what.clone(), waited, is_over })
    }
}

impl Gpu {
    /// From now on somebody is told, on a thread of its own, what a submission or the compiler of a kernel takes more than ten seconds for,
    /// and again when it has taken longer than `limit`.
    pub fn watch(&self, limit: Duration, tell: impl Fn(Waiting) + Send + 'static) -> Result<(), GpuError> {
        let watch: Weak<Watch> = Arc::downgrade(&self.watch);
        let look = move || {
            while let Some(watch) = watch.upgrade() {
                watch.look(limit).into_iter().for_each(&tell);
                drop(watch);
                thread::sleep(PERIOD);
            }
        };
        let thread = thread::Builder::new().name("watch".into()).spawn(look);
        thread.map(|_| ()).map_err(|error| GpuError::Refused { what: "a thread".into(), why: error.to_string() })
    }

    /// Does work that is watched.
    pub(super) fn watched<T>(&self, what: impl FnOnce() -> String, work: impl FnOnce() -> T) -> T {
        self.watch.set(Some(Work { what: what(), since: Instant::now(), is_told: false }));
        let made = work();
        self.watch.set(None);
        made
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_waited_for_is_named_once_and_when_it_is_over() {
        let watch = Watch::default();
        assert!(watch.look(Duration::ZERO).is_none());
        let since = Instant::now().checked_sub(QUIET).unwrap();
        watch.set(Some(Work { what: "a step".into(), since, is_told: false }));
        let told = watch.look(Duration::MAX).unwrap();
        assert_eq!((told.what.as_str(), told.is_over), ("a step", false));
        assert!(watch.look(Duration::MAX).is_none());
        assert!(watch.look(QUIET).unwrap().is_over);
        watch.set(None);
        assert!(watch.look(QUIET).is_none());
    }
}
