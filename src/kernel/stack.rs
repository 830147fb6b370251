//! Where kernels are parsed, validated and compiled: naga and drivers go down into an expression by recursion.

use std::thread;

/// The stack of that thread, in bytes. A kernel as deep as [`limits`](super::limits) allows has been seen to take an eighth of it; memory
/// that is not touched costs nothing.
const STACK_BYTES: usize = 64 << 20;

/// Runs work on a stack of a known size, whichever thread asks for it. It is an error if there is no memory for one, and if the work panics:
/// not all of naga has been shown every text.
pub fn on_large_stack<T: Send>(work: impl FnOnce() -> T + Send) -> Result<T, String> {
    thread::scope(|scope| {
        let thread = thread::Builder::new().name("kernel".into()).stack_size(STACK_BYTES).spawn_scoped(scope, work);
        let thread = thread.map_err(|error| format!("there is no stack for the compiler of kernels: {error}"))?;
        thread.join().map_err(|_| "the compiler of kernels failed".to_string())
    })
}
