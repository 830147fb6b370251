//! The threads that loops are shared out to, as many as the system allows.

use std::io::{self, ErrorKind};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex};
use std::thread;

use rayon::{ThreadBuilder, ThreadPoolBuilder};

use lodlab::experiment::diagnostic::Diagnostic;

/// Starts a thread for each processor, or as many as can be had. Left to itself, rayon would panic in the first loop if it does not get
/// all that it wants, and it cannot be asked a second time: so the threads are here before it hands out what they do.
pub fn start() -> Result<(), Diagnostic> {
    let (hand_out, work) = channel();
    let work = Arc::new(Mutex::new(work));
    let worker = |_| {
        let work = work.clone();
        thread::Builder::new().spawn(move || next(&work).map(ThreadBuilder::run)).map(|_| ())
    };
    let started: Vec<io::Result<()>> = (0..wanted()).map(worker).collect();
    let count = started.iter().filter(|started| started.is_ok()).count();
    match started.into_iter().next() {
        Some(Err(error)) if count == 0 => return Err(refused(&error)),
        _ => {}
    }
    let pool = ThreadPoolBuilder::new().num_threads(count);
    let pool = pool.spawn_handler(|thread| hand_out.send(thread).map_err(|_| ErrorKind::BrokenPipe.into()));
    pool.build_global().map_err(|error| refused(&error))
}

fn wanted() -> usize {
    // what rayon goes by, too
    let set = std::env::var("RAYON_NUM_THREADS").ok().and_then(|count| count.parse().ok());
    let set = set.filter(|count| *count > 0);
    set.unwrap_or_else(|| thread::available_parallelism().map_or(1, usize::from))
}

fn next(work: &Mutex<Receiver<ThreadBuilder>>) -> Option<ThreadBuilder> {
    work.lock().ok()?.recv().ok()
}

fn refused(error: &dyn std::error::Error) -> Diagnostic {
    Diagnostic::run(format!("no thread can be started: {error}"))
        .help("the system limits the processes and threads of a user; `ulimit -u` shows the limit")
}
