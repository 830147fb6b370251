//! What a plan carries out, as one hash: two plans with the same fingerprint compute the same.
//!
//! Names of stages and steps, meanings and what was left out are not part of it: they say how a plan is told, not what it does.

use std::collections::BTreeMap;

use blake3::Hasher;

use super::product::Drawn;
use super::{BufferId, Packing, Plan, Series, Step, Storage, Value, Vertices, Work};

impl Plan {
    /// Kernel texts, entry points, constants, parameters of every frame, sizes, and what is read back, in 32 hexadecimal digits.
    pub fn fingerprint(&self) -> String {
        let mut digest = Digest { hasher: Hasher::new(), numbers: BTreeMap::new() };
        digest.plan(self);
        digest.hasher.finalize().to_hex().as_str()[..32].to_string()
    }

    /// The kernel files that run and the hash of each text, sorted.
    pub fn kernels(&self) -> Vec<(String, String)> {
        let mut kernels: Vec<(String, String)> =
            self.steps.iter().map(|step| (step.kernel.name.clone(), step.kernel.hash.clone())).collect();
        kernels.sort();
        kernels.dedup();
        kernels
    }
}

struct Digest {
    hasher: Hasher,
    /// Buffers in the order in which they are first met: one that nothing touches changes no number.
    numbers: BTreeMap<BufferId, u64>,
}

impl Digest {
    fn number(&mut self, number: u64) {
        self.hasher.update(&number.to_le_bytes());
    }

    fn text(&mut self, text: &str) {
        self.number(text.len() as u64);
        self.hasher.update(text.as_bytes());
    }

    fn plan(&mut self, plan: &Plan) {
        self.number(plan.frames as u64);
        self.number(plan.steps.len() as u64);
        for step in &plan.steps {
            self.step(plan, step);
        }
        self.number(plan.slots.len() as u64);
        plan.slots.iter().for_each(|&bytes| self.number(bytes));
        self.number(plan.outputs.len() as u64);
        for &id in &plan.outputs {
            self.buffer(plan, id);
            self.text(&plan.buffer(id).name);
            self.number(plan.buffer(id).missing.is_some().into());
            self.number(match plan.buffer(id).packing {
                Packing::None => 0,
                Packing::Bytes => 1,
                Packing::Halves => 2,
            });
        }
        let promise = plan.products.latest::<Drawn<BufferId>>().and_then(|drawn| drawn.promise);
        self.number(promise.map_or(u64::MAX, |promise| promise.bound_px.to_bits()));
        self.number(plan.guards.len() as u64);
        for guard in &plan.guards {
            self.text(&guard.list);
            self.number(guard.capacity.into());
            self.buffer(plan, guard.needed);
            self.number(guard.at as u64);
        }
    }

    /// The buffer's number, and what it is where it is met for the first time.
    fn buffer(&mut self, plan: &Plan, id: BufferId) {
        let next = self.numbers.len() as u64;
        let number = *self.numbers.entry(id).or_insert(next);
        self.number(number);
        if number < next {
            return;
        }
        let buffer = plan.buffer(id);
        self.number(buffer.elem as u64);
        self.number(buffer.dims.len() as u64);
        buffer.dims.iter().for_each(|&side| self.number(side.into()));
        self.number(match buffer.storage {
            Storage::Input => 0,
            Storage::Buffer => 1,
            Storage::Target => 2,
        });
        self.number(buffer.lasts.into());
        self.number(buffer.slot.map_or(0, |slot| slot as u64 + 1));
    }

    fn step(&mut self, plan: &Plan, step: &Step) {
        self.text(&step.kernel.hash);
        self.number(step.kernel.trusted.into());
        self.text(&step.entry);
        self.number(step.often as u64);
        self.number(step.bindings.len() as u64);
        for (variable, id) in &step.bindings {
            self.text(variable);
            self.buffer(plan, *id);
        }
        self.number(step.constants.len() as u64);
        for (name, value) in &step.constants {
            self.text(name);
            self.number(value.to_bits());
        }
        self.number(step.params.len() as u64);
        for (name, series) in &step.params {
            self.text(name);
            self.series(series);
        }
        match &step.work {
            Work::Groups(groups) => groups.iter().for_each(|&count| self.number(count.into())),
            Work::Indirect(id) => self.buffer(plan, *id),
            Work::Draw { vertices, target, fragment } => {
                self.text(fragment);
                self.buffer(plan, *target);
                match vertices {
                    Vertices::Strip { vertices, .. } => self.number((*vertices).into()),
                    Vertices::List(id) => self.buffer(plan, *id),
                }
            }
        }
    }

    fn series(&mut self, series: &Series) {
        let values = match series {
            Series::Same(value) => std::slice::from_ref(value),
            Series::PerFrame(values) => values,
        };
        self.number(values.len() as u64);
        for value in values {
            // the type is the kernel's own, of which the text is hashed
            match value {
                Value::F32(numbers) => self.hasher.update(bytemuck::cast_slice(numbers)),
                Value::U32(numbers) => self.hasher.update(bytemuck::cast_slice(numbers)),
                Value::I32(numbers) => self.hasher.update(bytemuck::cast_slice(numbers)),
            };
        }
    }
}
