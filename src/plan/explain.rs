//! A plan as text, for `lodlab plan` and the report.

use std::fmt::Write;

use super::{Buffer, Often, Plan, Step, Storage, Vertices, Work};

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
                Work::Groups([x, y, z]) => format!("{x} x {y} x {z} workgroups"),
                Work::Indirect(id) => format!("workgroups from `{}`", plan.buffer(*id).name),
                Work::Draw { vertices: Vertices::Strip { triangles, .. }, .. } => format!("{triangles} triangles"),
                Work::Draw { vertices: Vertices::List(id), .. } => {
                    format!("triangles from `{}`", plan.buffer(*id).name)
                }
            };
            writeln!(out, "    {:<14} {:<22} {work}{}", step.stage, step.label, constants(step))?;
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

/// The variant of the kernel that runs.
fn constants(step: &Step) -> String {
    let known = step.constants.iter().filter(|(name, _)| step.kernel.overrides.contains(name));
    let shown: Vec<String> = known.map(|(name, value)| format!("{name}={value}")).collect();
    if shown.is_empty() { String::new() } else { format!(" [{}]", shown.join(" ")) }
}

fn describe(buffer: &Buffer) -> String {
    let dims: Vec<String> = buffer.dims.iter().map(u32::to_string).collect();
    let place = match (buffer.storage, buffer.slot) {
        (Storage::Input, _) => "uploaded".to_string(),
        (Storage::Target, _) => "render target".to_string(),
        (_, Some(slot)) => format!("block {slot}"),
        (_, None) => "own memory".to_string(),
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
