//! How large and how deep a kernel may be, and what it may ask of an adapter: what WebGPU promises on every one.
//!
//! naga goes down into expressions, blocks and types by recursion. It counts blocks, brackets and types itself (up to 200 in one another), but
//! not the operators of one expression (`a + a + a`, `a.x[1].y`) and not the branches of one condition (`else if`).

use naga::valid::ModuleInfo;
use naga::{AddressSpace, Module};

use super::Assembled;
use super::tokens::tokens;
use crate::experiment::diagnostic::Diagnostic;

/// Bytes of a kernel with all that it includes.
const MOST_BYTES: usize = 1 << 20;
/// Operators, brackets and branches in one another.
const DEEPEST: usize = 4096;

/// Numbers of bindings are below this, and parameters take no more bytes.
pub const BINDINGS: u32 = 1000;
pub const PARAMETER_BYTES: u32 = 65_536;

/// Threads of a workgroup, along each axis and in all, and bytes that they share.
const WORKGROUP: [u32; 3] = [256, 256, 64];
const WORKGROUP_THREADS: u64 = 256;
const WORKGROUP_BYTES: u64 = 16_384;

/// What is open between two brackets: operators since the last `,` or `;`, and branches since the condition began.
#[derive(Default)]
struct Level {
    operators: usize,
    branches: usize,
}

/// How deep a compiler is at a place of the text, or deeper than it is.
struct Nesting {
    levels: Vec<Level>,
    depth: usize,
    has_block_ended: bool,
}

impl Nesting {
    fn top(&mut self) -> &mut Level {
        if self.levels.is_empty() {
            self.levels.push(Level::default());
        }
        let last = self.levels.len() - 1;
        &mut self.levels[last]
    }

    fn take(&mut self, word: &str) {
        if std::mem::take(&mut self.has_block_ended) && word != "else" {
            self.depth -= std::mem::take(&mut self.top().branches);
        }
        match word {
            "{" => {
                self.end_part();
                self.open();
            }
            "(" | "[" => self.open(),
            ")" | "}" => self.close(word),
            "]" => {
                self.close(word);
                // an index is an operator, too
                self.add_operator();
            }
            "," | ";" => self.end_part(),
            "else" => {
                self.top().branches += 1;
                self.depth += 1;
            }
            _ if word.starts_with(|letter: char| "+-*/%&|^<>!~=.".contains(letter)) => self.add_operator(),
            _ => {}
        }
    }

    fn open(&mut self) {
        self.levels.push(Level::default());
        self.depth += 1;
    }

    fn close(&mut self, word: &str) {
        // a bracket that nothing has opened is for naga to refuse
        if self.levels.len() > 1 {
            let closed = self.levels.pop().unwrap_or_default();
            self.depth -= closed.operators + closed.branches + 1;
        }
        self.has_block_ended = word == "}";
    }

    fn add_operator(&mut self) {
        self.top().operators += 1;
        self.depth += 1;
    }

    fn end_part(&mut self) {
        self.depth -= std::mem::take(&mut self.top().operators);
    }
}

/// Refuses a text in which a compiler could lose itself.
pub fn check_text(assembled: &Assembled) -> Result<(), Diagnostic> {
    let text = &assembled.text;
    if text.len() > MOST_BYTES {
        return Err(Diagnostic::input(format!("a kernel of {} bytes", text.len()))
            .at(&assembled.main.everywhere(), format!("expected at most {MOST_BYTES}, with what it includes")));
    }
    let mut nesting = Nesting { levels: vec![Level::default()], depth: 0, has_block_ended: false };
    for token in tokens(text) {
        nesting.take(&text[token.clone()]);
        if nesting.depth > DEEPEST {
            return Err(Diagnostic::input(format!(
                "more than {DEEPEST} operators, brackets or branches in one another"
            ))
            .at(&assembled.origin(token), "this is too deep")
            .help("give names to parts with `let`, and use loops, functions or `switch`"));
        }
    }
    Ok(())
}

/// Refuses an entry point that asks for more than WebGPU promises. `module` has all `override` constants in place.
pub fn check_entry(assembled: &Assembled, module: &Module, info: &ModuleInfo, name: &str) -> Result<(), Diagnostic> {
    let Some(number) = module.entry_points.iter().position(|entry| entry.name == name) else { return Ok(()) };
    let entry = &module.entry_points[number];
    let origin = assembled.origin(name_of(&assembled.text, &entry.name));
    let size = entry.workgroup_size;
    let threads: u64 = size.iter().map(|&side| u64::from(side)).product();
    if size.iter().zip(WORKGROUP).any(|(&side, most)| side > most) || threads > WORKGROUP_THREADS {
        let [x, y, z] = WORKGROUP;
        return Err(Diagnostic::input(format!("workgroups of {} x {} x {} threads", size[0], size[1], size[2])).at(
            &origin,
            format!("expected at most {x} x {y} x {z}, and {WORKGROUP_THREADS} in all, as every adapter has"),
        ));
    }
    let mut layouter = naga::proc::Layouter::default();
    layouter.update(module.to_ctx()).map_err(|error| Diagnostic::input(error.to_string()).at(&origin, "used here"))?;
    let used = info.get_entry_point(number);
    let shared = module
        .global_variables
        .iter()
        .filter(|(handle, variable)| variable.space == AddressSpace::WorkGroup && !used[*handle].is_empty());
    let bytes: u64 = shared.map(|(_, variable)| u64::from(layouter[variable.ty].size).next_multiple_of(16)).sum();
    if bytes > WORKGROUP_BYTES {
        return Err(Diagnostic::input(format!("a workgroup shares {bytes} bytes"))
            .at(&origin, format!("expected at most {WORKGROUP_BYTES}, as every adapter has"))
            .help("make arrays of `var<workgroup>` smaller"));
    }
    Ok(())
}

/// Where the name of a function stands.
fn name_of(text: &str, name: &str) -> std::ops::Range<usize> {
    let mut is_next = false;
    let mut found = tokens(text).filter(|token| {
        let word = &text[token.clone()];
        std::mem::replace(&mut is_next, word == "fn") && word == name
    });
    found.next().unwrap_or(0..0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn depth_of(text: &str) -> usize {
        let mut nesting = Nesting { levels: vec![Level::default()], depth: 0, has_block_ended: false };
        let taken = tokens(text).map(|token| {
            nesting.take(&text[token]);
            nesting.depth
        });
        taken.max().unwrap_or(0)
    }

    #[test]
    fn what_is_in_one_another_adds_up_and_what_follows_does_not() {
        assert_eq!(depth_of("a + a + a"), 2);
        assert_eq!(depth_of("a + (a + (a - b))"), 5);
        assert_eq!(depth_of("f(a + b, a + b, a + b); f(a + b);"), 2);
        assert_eq!(depth_of("a.x[1].y"), 3);
        assert_eq!(depth_of(&"{ x(); } ".repeat(9)), 2);
        assert_eq!(depth_of("if a < b { x(); } else if a < c { x(); } else { x(); } if a { x(); }"), 4);
        assert_eq!(depth_of(")]}>"), 2);
    }
}
