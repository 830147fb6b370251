//! A user's formula is not known here, but those of the kernels that ship as examples are: what binds, repeats and swaps their buffers
//! is checked with them.

use std::sync::Arc;

use super::{Attached, CHANGE, CURVATURE, Kernel, SMOOTH};
use crate::reference::{Absent, Buffers, Frame, Reference, Values};
use crate::scene::HEIGHT;
use crate::stages::shared::rounding::EPSILON;

impl Reference for Kernel {
    fn reference(&self, frame: &Frame, buffers: &mut Buffers) -> Result<(), Absent> {
        let unknown = || Absent(format!("the formula of `{}`", self.kernel.name));
        let formula = match self.kernel.assembled.main.text.as_str() {
            CURVATURE => Formula::Curvature,
            SMOOTH => Formula::Smooth,
            CHANGE => Formula::Change,
            _ => return Err(unknown()),
        };
        let made = self.bind.iter().find_map(|(_, attached, _)| match attached {
            Attached::New(new) => Some(new.name.as_str()),
            _ => None,
        });
        let made = made.ok_or_else(unknown)?;
        let values = match formula {
            Formula::Change => {
                let now = self.source("now", frame, buffers)?.ok_or_else(unknown)?;
                change(&now, self.source("before", frame, buffers)?.as_deref())
            }
            _ => {
                let mut values = (*self.source("src", frame, buffers)?.ok_or_else(unknown)?).clone();
                for _ in 0..self.repeat {
                    values = match formula {
                        Formula::Smooth => smooth(&values),
                        _ => curvature(frame, &values, self.scale()),
                    };
                }
                values
            }
        };
        let id = buffers.put(made, values);
        if made == HEIGHT {
            buffers.change_ground(id);
        }
        Ok(())
    }
}

/// What is known of the kernels that ship as examples.
#[derive(Clone, Copy)]
enum Formula {
    Curvature,
    Smooth,
    Change,
}

impl Kernel {
    /// What a variable is attached to; nothing if that is of the frame before, and there was none.
    fn source(&self, variable: &str, frame: &Frame, buffers: &Buffers) -> Result<Option<Arc<Values>>, Absent> {
        let found = self.bind.iter().find(|(name, ..)| name == variable).map(|(_, attached, _)| attached);
        match found {
            Some(Attached::Existing(name)) => buffers.get(name).map(Some),
            Some(Attached::Last(name)) => frame.previous.map(|previous| previous.get(name)).transpose(),
            _ => Err(Absent(format!("the variable `{variable}`"))),
        }
    }
}

/// How much farther each pixel's surface is than it was before; 0 where it is not known in both frames.
fn change(now: &Values, before: Option<&Values>) -> Values {
    let mut made = Values::exact(&now.dims, 1, vec![0.0; now.value.len()]);
    let Some(before) = before else { return made };
    for at in 0..now.value.len() {
        let (a, b) = (now.value[at], before.value[at]);
        let off = now.bound[at] + before.bound[at];
        // below 0 there is no surface, as long as rounding does not decide that
        let is_known = a >= 0.0 && b >= 0.0;
        let is_near = a.abs() < now.bound[at] || b.abs() < before.bound[at];
        match is_known {
            _ if off.is_infinite() || is_near => made.set(at, 0.0, f64::INFINITY),
            true => made.set(at, a - b, off + EPSILON * (a - b).abs()),
            false => made.set(at, 0.0, 0.0),
        }
    }
    made
}

impl Kernel {
    fn scale(&self) -> f64 {
        let scale = self.params.iter().find(|(name, ..)| name == "scale");
        scale.and_then(|(_, node, _)| node.parse().ok()).unwrap_or(1.0)
    }
}

/// The Laplacian by central differences, 0 at the border.
fn curvature(frame: &Frame, source: &Values, scale: f64) -> Values {
    let [rows, columns] = source.dims[..] else { return Values::missing(&source.dims, 1) };
    let cell_m = frame.lattice().cell_m;
    let mut made = Values::exact(&source.dims, 1, vec![0.0; source.value.len()]);
    for (y, x) in (1..rows.saturating_sub(1)).flat_map(|y| (1..columns.saturating_sub(1)).map(move |x| (y, x))) {
        let at = (y * columns + x) as usize;
        let line = |step: usize, side_m: f64| {
            let [a, b, c] = [at - step, at, at + step];
            let (v, off) = (&source.value, &source.bound);
            let terms = v[a].abs() + 2.0 * v[b].abs() + v[c].abs();
            (
                (v[a] - 2.0 * v[b] + v[c]) / side_m.powi(2),
                (8.0 * EPSILON * terms + off[a] + 2.0 * off[b] + off[c]) / side_m.powi(2),
            )
        };
        let (across, along) = (line(1, cell_m.x), line(columns as usize, cell_m.y));
        let value = scale * (across.0 + along.0);
        made.set(at, value, scale.abs() * (across.1 + along.1) + 8.0 * EPSILON * value.abs());
    }
    made
}

/// A 3 x 3 binomial filter whose borders repeat.
fn smooth(source: &Values) -> Values {
    let [rows, columns] = source.dims[..] else { return Values::missing(&source.dims, 1) };
    let mut made = Values::missing(&source.dims, 1);
    for (y, x) in (0..rows).flat_map(|y| (0..columns).map(move |x| (y, x))) {
        let inside = |at: u32, by: i32, side: u32| at.saturating_add_signed(by).min(side - 1);
        let (mut value, mut terms, mut off) = (0.0, 0.0, 0.0);
        for (dy, dx) in (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dy, dx))) {
            let at = (inside(y, dy, rows) * columns + inside(x, dx, columns)) as usize;
            let weight = f64::from((2 - dy.abs()) * (2 - dx.abs())) / 16.0;
            value += weight * source.value[at];
            terms += weight * source.value[at].abs();
            off += weight * source.bound[at];
        }
        // nine products and sums, of which no part is larger than the sum of all magnitudes
        made.set((y * columns + x) as usize, value, off + 16.0 * EPSILON * terms);
    }
    made
}
