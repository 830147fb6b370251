//! The thread that plans, runs and reads, so that the window never waits for it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

use super::ask::Ask;
use super::subject::{Subject, Work};
use super::wish::{Answer, Side, Told, Wish};
use super::{export, probe};
use crate::experiment::diagnostic::Diagnostic;
use crate::gpu::Gpu;

/// What the window sends.
enum Sent {
    Wish(Side, Box<Wish>),
    Ask(u64, Box<Ask>),
    End,
}

pub struct Worker {
    to: Sender<Sent>,
    from: Receiver<Told>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    /// Messages that were sent, and those that are done.
    sent: usize,
    done: usize,
    next: u64,
}

/// Wakes the window up when there is something to see.
pub type Wake = Arc<dyn Fn() + Send + Sync>;

impl Worker {
    pub fn new(gpu: &Arc<Gpu>, wake: Wake) -> Self {
        let (to, sent) = channel();
        let (tell, from) = channel();
        let stop = Arc::new(AtomicBool::new(false));
        let (gpu, stopped) = (gpu.clone(), stop.clone());
        let thread = std::thread::spawn(move || work(&gpu, &sent, &tell, &stopped, &wake));
        Self { to, from, stop, thread: Some(thread), sent: 0, done: 0, next: 0 }
    }

    /// Wants something on one side; what was wanted before and is not begun is forgotten.
    pub fn wish(&mut self, side: Side, wish: Wish) {
        self.send(Sent::Wish(side, Box::new(wish)));
    }

    /// Asks something; the answer has the same number.
    pub fn ask(&mut self, ask: Ask) -> u64 {
        self.next += 1;
        self.send(Sent::Ask(self.next, Box::new(ask)));
        self.next
    }

    fn send(&mut self, sent: Sent) {
        self.sent += usize::from(self.to.send(sent).is_ok());
    }

    /// What there is to hear by now.
    pub fn told(&mut self) -> Vec<Told> {
        let told: Vec<Told> = self.from.try_iter().collect();
        let done = |told: &Told| if let Told::Idle(done) = told { Some(*done) } else { None };
        self.done = told.iter().rev().find_map(done).unwrap_or(self.done);
        told
    }

    /// Ends what is being worked on.
    pub fn cancel(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    pub fn is_busy(&self) -> bool {
        self.sent > self.done
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.cancel();
        let _ = self.to.send(Sent::End);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// What there is to do: the latest wish of each side, and all questions in order.
#[derive(Default)]
struct Todo {
    wishes: [Option<Box<Wish>>; 2],
    asks: Vec<(u64, Box<Ask>)>,
    ends: bool,
    received: usize,
}

impl Todo {
    fn add(&mut self, sent: Sent) {
        self.received += 1;
        match sent {
            Sent::Wish(side, wish) => self.wishes[side as usize] = Some(wish),
            Sent::Ask(number, ask) => self.asks.push((number, ask)),
            Sent::End => self.ends = true,
        }
    }

    fn is_empty(&self) -> bool {
        self.wishes.iter().all(Option::is_none) && self.asks.is_empty()
    }

    /// Takes in what has come; waits for it if there is nothing to do.
    fn fill(&mut self, sent: &Receiver<Sent>) {
        if self.is_empty() && !self.ends {
            match sent.recv() {
                Ok(first) => self.add(first),
                Err(_) => self.ends = true,
            }
        }
        loop {
            match sent.try_recv() {
                Ok(more) => self.add(more),
                Err(TryRecvError::Empty) => return,
                Err(TryRecvError::Disconnected) => {
                    self.ends = true;
                    return;
                }
            }
        }
    }
}

fn work(gpu: &Arc<Gpu>, sent: &Receiver<Sent>, tell: &Sender<Told>, stop: &AtomicBool, wake: &Wake) {
    let mut subjects = [Subject::new(gpu), Subject::new(gpu)];
    let mut todo = Todo::default();
    let say = |told: Told| {
        let _ = tell.send(told);
        wake();
    };
    // progress comes from within borrowed closures
    let progress = Mutex::new(tell.clone());
    loop {
        todo.fill(sent);
        if todo.ends {
            return;
        }
        stop.store(false, Ordering::Relaxed);
        // while somebody waits, the window draws often enough to show this without being woken up
        let note = |what: String, share: Option<f32>| {
            let _ = progress.lock().unwrap_or_else(PoisonError::into_inner).send(Told::Working { what, share });
        };
        let work = Work { tell: &note, stop };
        if let Some(side) = Side::BOTH.into_iter().find(|side| todo.wishes[*side as usize].is_some()) {
            let Some(wish) = todo.wishes[side as usize].take() else { continue };
            match subjects[side as usize].update(&wish, &work) {
                Ok(shown) => say(Told::Shown(side, shown)),
                Err(error) => say(Told::Refused(side, wish, error)),
            }
        } else if !todo.asks.is_empty() {
            let (number, ask) = todo.asks.remove(0);
            say(Told::Answer(number, answer(gpu, &ask)));
        }
        // whatever came in the meantime is done before the worker says that it is idle
        while let Ok(more) = sent.try_recv() {
            todo.add(more);
        }
        if todo.is_empty() && !todo.ends {
            say(Told::Idle(todo.received));
        }
    }
}

fn answer(gpu: &Gpu, ask: &Ask) -> Answer {
    match ask {
        Ask::Statistics { of, range, scale } => Answer::Statistics(of.seen(gpu, *range, *scale)),
        Ask::Bytes { held, at, elements } => Answer::Bytes(held.read(gpu, *at, *elements).map_err(Diagnostic::from)),
        Ask::Probe { shown, from, at, views } => Answer::Probed(probe::probe(gpu, shown, from, *at, views)),
        Ask::Picture { canvas, path } => Answer::Done(export::canvas(gpu, canvas, path)),
        Ask::Export { held, path } => Answer::Done(export::export(gpu, held, path)),
    }
}
