//! How often the loops of a kernel turn, as far as its text says so.
//!
//! Counted are loops that compare a variable with a constant or a parameter, change it by one and begin it with one. What depends on a
//! buffer, on sums or on a `break` is not known here: such a loop counts as one turn, and one that ends early counts as if it did not.

use std::collections::HashMap;

use naga::{
    AddressSpace, BinaryOperator, Block, EntryPoint, Expression, Function, Handle, Literal, LocalVariable, Module,
    Statement, TypeInner,
};

/// The turns of all loops that a thread of an entry point goes through, one after the other and in one another. `parameter` is the value of
/// a field of the kernel's uniform structure, where it is a whole number and known.
pub fn turns(module: &Module, entry: &EntryPoint, parameter: &dyn Fn(&str) -> Option<i64>) -> u64 {
    let mut called = HashMap::new();
    // a function stands behind those that it calls
    for (handle, function) in module.functions.iter() {
        let turns =
            Counter { module, function, parameter, called: &called, known: HashMap::new() }.block(&function.body);
        called.insert(handle, turns);
    }
    Counter { module, function: &entry.function, parameter, called: &called, known: HashMap::new() }
        .block(&entry.function.body)
}

struct Counter<'a> {
    module: &'a Module,
    function: &'a Function,
    parameter: &'a dyn Fn(&str) -> Option<i64>,
    called: &'a HashMap<Handle<Function>, u64>,
    /// Variables that have just been given a constant.
    known: HashMap<Handle<LocalVariable>, i64>,
}

impl Counter<'_> {
    fn block(&mut self, block: &Block) -> u64 {
        block.iter().fold(0, |turns: u64, statement| turns.saturating_add(self.statement(statement)))
    }

    fn statement(&mut self, statement: &Statement) -> u64 {
        match statement {
            Statement::Store { pointer, value } => {
                if let Some(variable) = self.variable(*pointer) {
                    match self.constant(*value) {
                        Some(constant) => self.known.insert(variable, constant),
                        None => self.known.remove(&variable),
                    };
                }
                0
            }
            Statement::Block(block) => self.block(block),
            Statement::If { accept, reject, .. } => self.block(accept).max(self.block(reject)),
            Statement::Switch { cases, .. } => cases.iter().map(|case| self.block(&case.body)).max().unwrap_or(0),
            Statement::Loop { body, continuing, .. } => {
                let own = self.turns_of(body, continuing).unwrap_or(1);
                let inner = self.block(body).saturating_add(self.block(continuing));
                own.saturating_mul(inner.saturating_add(1))
            }
            Statement::Call { function, .. } => self.called.get(function).copied().unwrap_or(0),
            _ => 0,
        }
    }

    /// The turns of a loop as `for` makes them: the way out stands first, the step in the end.
    fn turns_of(&self, body: &Block, continuing: &Block) -> Option<u64> {
        let (condition, is_stay) = body.iter().find_map(|statement| match statement {
            Statement::If { condition, accept, reject } if is_way_out(reject) && accept.is_empty() => {
                Some((*condition, true))
            }
            Statement::If { condition, accept, reject } if is_way_out(accept) && reject.is_empty() => {
                Some((*condition, false))
            }
            _ => None,
        })?;
        let Expression::Binary { op, left, right } = self.function.expressions[condition] else { return None };
        let variable = self.loaded(left)?;
        let bound = self.constant(right)?;
        let init = self.function.local_variables[variable].init.and_then(|init| self.constant(init));
        let start = self.known.get(&variable).copied().or(init)?;
        let steps = [flat(continuing), flat(body)].concat();
        let step = steps.into_iter().find_map(|statement| match statement {
            Statement::Store { pointer, value } if self.variable(*pointer) == Some(variable) => {
                self.step(*value, variable)
            }
            _ => None,
        })?;
        use BinaryOperator::{Greater, GreaterEqual, Less, LessEqual, NotEqual};
        let way = match (op, is_stay) {
            (Less | NotEqual, true) | (GreaterEqual, false) if step > 0 => bound - start,
            (LessEqual, true) | (Greater, false) if step > 0 => bound - start + 1,
            (Greater | NotEqual, true) | (LessEqual, false) if step < 0 => start - bound,
            (GreaterEqual, true) | (Less, false) if step < 0 => start - bound + 1,
            _ => return None,
        };
        Some((way.max(0) as u64).div_ceil(step.unsigned_abs()))
    }

    fn step(&self, value: Handle<Expression>, variable: Handle<LocalVariable>) -> Option<i64> {
        match self.function.expressions[value] {
            Expression::Binary { op: BinaryOperator::Add, left, right } if self.loaded(left) == Some(variable) => {
                self.constant(right)
            }
            Expression::Binary { op: BinaryOperator::Subtract, left, right } if self.loaded(left) == Some(variable) => {
                self.constant(right).map(|step| -step)
            }
            _ => None,
        }
    }

    fn variable(&self, pointer: Handle<Expression>) -> Option<Handle<LocalVariable>> {
        match self.function.expressions[pointer] {
            Expression::LocalVariable(variable) => Some(variable),
            _ => None,
        }
    }

    fn loaded(&self, value: Handle<Expression>) -> Option<Handle<LocalVariable>> {
        match self.function.expressions[value] {
            Expression::Load { pointer } => self.variable(pointer),
            _ => None,
        }
    }

    fn constant(&self, value: Handle<Expression>) -> Option<i64> {
        let global = |value: Handle<Expression>| number(&self.module.global_expressions[value]);
        match &self.function.expressions[value] {
            Expression::Constant(constant) => global(self.module.constants[*constant].init),
            Expression::Override(constant) => global(self.module.overrides[*constant].init?),
            Expression::Load { pointer } => (self.parameter)(self.field(*pointer)?),
            own => number(own),
        }
    }

    /// The name of a field of the kernel's uniform structure.
    fn field(&self, pointer: Handle<Expression>) -> Option<&str> {
        let Expression::AccessIndex { base, index } = self.function.expressions[pointer] else { return None };
        let Expression::GlobalVariable(variable) = self.function.expressions[base] else { return None };
        let variable = &self.module.global_variables[variable];
        match (variable.space, &self.module.types[variable.ty].inner) {
            (AddressSpace::Uniform, TypeInner::Struct { members, .. }) => members.get(index as usize)?.name.as_deref(),
            _ => None,
        }
    }
}

/// The statements of a block, and of plain blocks in it.
fn flat(block: &Block) -> Vec<&Statement> {
    let mut found = Vec::new();
    for statement in block.iter() {
        match statement {
            Statement::Block(block) => found.extend(flat(block)),
            own => found.push(own),
        }
    }
    found
}

fn is_way_out(block: &Block) -> bool {
    matches!(block.iter().next(), Some(Statement::Break)) && block.len() == 1
}

fn number(value: &Expression) -> Option<i64> {
    match value {
        Expression::Literal(Literal::U32(value)) => Some((*value).into()),
        Expression::Literal(Literal::I32(value)) => Some((*value).into()),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turns_of(body: &str) -> u64 {
        let text = format!(
            "const MOST: u32 = 300u;\noverride MORE: u32 = 7u;\nstruct Params {{ least: u32, most: u32 }}\n@group(0) @binding(1) var<uniform> params: Params;\n@group(0) @binding(0) var<storage, read_write> x: array<u32>;\n\
             fn ten() {{ for (var i = 0; i < 10; i++) {{ x[i] = 1u; }} }}\n@compute @workgroup_size(1) fn main() {{ {body} }}"
        );
        let module =
            naga::front::wgsl::parse_str(&text).unwrap_or_else(|error| panic!("{}", error.emit_to_string(&text)));
        turns(&module, &module.entry_points[0], &|name| (name == "most").then_some(70_000))
    }

    #[test]
    fn constant_bounds_are_counted() {
        assert_eq!(turns_of("x[0] = 1u;"), 0);
        assert_eq!(turns_of("for (var k = 0u; k < 40000u; k++) { x[k] = 1u; }"), 40_000);
        assert_eq!(turns_of("for (var k = 10; k > 0; k -= 3) { x[k] = 1u; }"), 4);
        assert_eq!(turns_of("for (var k = 2u; k <= MOST; k += 2u) { x[k] = 1u; }"), 150);
        assert_eq!(turns_of("for (var k = 0u; k < MORE; k++) { x[k] = 1u; }"), 7);
        assert_eq!(turns_of("var k = 0u; while k < 5u { k++; }"), 5);
        assert_eq!(turns_of("var k = 0u; loop { if k >= 5u { break; } x[k] = 1u; continuing { k++; } }"), 5);
    }

    #[test]
    fn parameters_are_bounds_where_they_are_known() {
        assert_eq!(turns_of("for (var k = 0u; k < params.most; k++) { x[k] = 1u; }"), 70_000);
        assert_eq!(turns_of("for (var k = 0u; k < params.least; k++) { x[k] = 1u; }"), 1);
    }

    #[test]
    fn loops_add_up_and_multiply() {
        let inner = "for (var k = 0u; k < 300u; k++) { for (var j = 0u; j < MOST; j++) { x[k] = 1u; } }";
        assert_eq!(turns_of(inner), 300 * 301);
        assert_eq!(turns_of("ten(); ten(); if x[0] == 1u { ten(); }"), 30);
        assert_eq!(turns_of("for (var k = 0u; k < 3u; k++) { ten(); }"), 3 * 11);
    }

    #[test]
    fn what_is_not_known_is_one_turn() {
        assert_eq!(turns_of("for (var k = 0u; k < x[0]; k++) { x[k] = 1u; }"), 1);
        assert_eq!(turns_of("loop { if x[0] == 1u { break; } }"), 1);
    }
}
