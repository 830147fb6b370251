//! A plan as text, for `lodlab plan` and the report.

use std::fmt::Write;

use super::ground::GROUND_CONSTANT;
use super::{Buffer, BufferId, How, Life, Often, Plan, Run, Storage, Vertices, Work};

/// What runs, on what, and what was left out and why.
pub fn explain(plan: &Plan) -> String {
    let mut text = String::new();
    // writing to a String cannot fail
    let _ = write_plan(plan, &mut text);
    text
}

fn write_plan(plan: &Plan, out: &mut String) -> std::fmt::Result {
    writeln!(out, "  {} frame(s), {}", plan.frames, megabytes(plan.bytes()))?;
    for (often, title) in [(Often::Once, "once a terrain"), (Often::EveryFrame, "every frame")] {
        let steps: Vec<_> = plan.steps.iter().filter(|step| step.often == often).collect();
        if !steps.is_empty() {
            writeln!(out, "  {title}:")?;
        }
        for step in steps {
            let work = match &step.work {
                Work::Run(run) => format!("{}{}", how(plan, run), constants(run)),
                Work::Upload(id) => uploaded(plan, *id),
                Work::Copy { from, .. } => format!("keeps `{}` as it is here", plan.buffer(*from).name),
            };
            writeln!(out, "    {:<14} {:<22} {work}", step.stage, step.label)?;
        }
    }
    writeln!(out, "  buffers:")?;
    for buffer in plan.buffers.iter().filter(|buffer| buffer.lifetime.is_some()) {
        writeln!(out, "    {}", describe(buffer))?;
    }
    writeln!(out, "  left out:{}", if plan.left_out.is_empty() { " nothing" } else { "" })?;
    for left in &plan.left_out {
        write!(out, "    {} - {}", left.what, left.reason)?;
        if left.saved_bytes > 0 {
            write!(out, "; saves {}", megabytes(left.saved_bytes))?;
        }
        if left.saved_threads > 0 {
            write!(out, "; saves {} threads", left.saved_threads)?;
        }
        writeln!(out)?;
    }
    Ok(())
}

fn how(plan: &Plan, run: &Run) -> String {
    match &run.how {
        How::Groups([x, y, z]) => format!("{x} x {y} x {z} workgroups"),
        How::Indirect(id) => format!("workgroups from `{}`", plan.buffer(*id).name),
        How::Draw { vertices: Vertices::Strip { triangles, .. }, .. } => format!("{triangles} triangles"),
        How::Draw { vertices: Vertices::List(id), .. } => format!("triangles from `{}`", plan.buffer(*id).name),
    }
}

/// The bytes of an input, in each form in which kernels bind it.
fn uploaded(plan: &Plan, id: BufferId) -> String {
    let (is_array, is_image) = plan.bound_as(id);
    let forms = [(is_array, "array"), (is_image, "image")].into_iter().filter(|(is_bound, _)| *is_bound);
    let bytes = megabytes(plan.buffer(id).bytes());
    forms.map(|(_, form)| format!("{bytes} as {form}")).collect::<Vec<_>>().join(", ")
}

/// The variant of the kernel that runs.
fn constants(run: &Run) -> String {
    let own = run.constants().filter(|(name, _)| !name.starts_with(GROUND_CONSTANT));
    let shown: Vec<String> = own.map(|(name, value)| format!("{name}={value}")).collect();
    if shown.is_empty() { String::new() } else { format!(" [{}]", shown.join(" ")) }
}

fn describe(buffer: &Buffer) -> String {
    let dims: Vec<String> = buffer.dims.iter().map(u32::to_string).collect();
    let place = match (buffer.storage, buffer.slot, buffer.life) {
        (Storage::Input, ..) => "uploaded".to_string(),
        (Storage::Target, ..) => "render target".to_string(),
        (.., Life::Kept) => "kept for the next frame".to_string(),
        (.., Life::Next | Life::LastOf(_)) => "half of a pair".to_string(),
        (_, Some(slot), _) => format!("block {slot}"),
        (_, None, _) => "own memory".to_string(),
    };
    let lives = buffer.lifetime.map_or(String::new(), |(first, last)| format!("steps {first}..{last}"));
    format!(
        "{:<14} {:<8} [{}] {}, {place}, {lives}: {}{}",
        buffer.name,
        format!("{:?}", buffer.elem),
        dims.join(", "),
        megabytes(buffer.bytes()),
        buffer.meaning,
        if buffer.unit.is_empty() { String::new() } else { format!(" ({})", buffer.unit) },
    )
}

pub fn megabytes(bytes: u64) -> String {
    match bytes {
        0..1_000_000 => format!("{:.1} kB", bytes as f64 / 1e3),
        _ => format!("{:.1} MB", bytes as f64 / 1e6),
    }
}
