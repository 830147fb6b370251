//! The plan as it is: what each stage does, its steps with their times, what was left out and why, and which step reads and writes what.

use egui::{Color32, RichText, ScrollArea, Sense, Ui, Vec2};

use crate::inspector::desk::{Action, Desk};
use crate::inspector::view::Of;
use crate::inspector::wish::{Shown, Side};
use crate::plan::{BufferId, Often, Plan, Step, step_names};
use crate::stages;

/// What of the pane is open.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct ChainPane {
    pub side: Side,
    pub matrix: bool,
}

impl ChainPane {
    pub fn ui(&mut self, ui: &mut Ui, desk: &mut Desk) {
        ui.horizontal(|ui| {
            if desk.compares {
                for (side, name) in Side::BOTH.into_iter().zip(["A", "B"]) {
                    ui.selectable_value(&mut self.side, side, name);
                }
            }
            ui.selectable_value(&mut self.matrix, false, "steps");
            ui.selectable_value(&mut self.matrix, true, "who reads and writes what");
        });
        let Some(shown) = desk.shown(self.side).cloned() else {
            ui.weak("nothing is shown yet");
            return;
        };
        let total: f64 = shown.step_ms.values().sum();
        let time =
            if shown.step_ms.is_empty() { String::new() } else { format!(", its steps by themselves {total:.2} ms") };
        let made = shown.made_ms.map_or(String::new(), |ms| format!("planned and prepared in {ms:.1} ms, "));
        ui.small(format!(
            "{} steps, {}; {made}the frame took {:.2} ms here{time}",
            shown.run_plan.steps.len(),
            crate::plan::megabytes(shown.run_plan.bytes()),
            shown.frame_ms
        ));
        ScrollArea::both().id_salt("chain").auto_shrink(false).show(ui, |ui| match self.matrix {
            true => self.matrix(ui, desk, &shown),
            false => self.stages(ui, desk, &shown),
        });
    }

    fn stages(&self, ui: &mut Ui, desk: &mut Desk, shown: &Shown) {
        let plan = &shown.run_plan;
        let names = step_names(&plan.steps);
        let longest = shown.step_ms.values().copied().fold(0.0, f64::max);
        let of_scene = steps_of(plan, usize::MAX);
        if !of_scene.is_empty() {
            ui.strong("scene");
            of_scene.iter().for_each(|&at| self.step(ui, desk, shown, at, &names[at], longest));
        }
        for (index, call) in shown.prepared.cell.stages.iter().enumerate() {
            ui.add_space(6.0);
            let steps = steps_of(plan, index);
            ui.horizontal(|ui| {
                let title = RichText::new(&call.name).strong();
                ui.label(if steps.is_empty() { title.color(Color32::GRAY).strikethrough() } else { title });
                let mut on_cpu = desk.on_cpu.contains(&call.name);
                let hover = "its f64 result goes to the kernels after it";
                if ui.checkbox(&mut on_cpu, "on the CPU").on_hover_text(hover).changed() {
                    desk.act(Action::OnCpu { stage: call.name.clone(), on: on_cpu });
                }
            });
            if let Some(entry) = stages::find(&call.name) {
                ui.label(entry.info.summary);
                if !entry.info.formula.is_empty() {
                    ui.monospace(entry.info.formula);
                }
                if !entry.info.source.is_empty() {
                    ui.small(RichText::new(entry.info.source).italics());
                }
            }
            steps.iter().for_each(|&at| self.step(ui, desk, shown, at, &names[at], longest));
        }
        ui.add_space(8.0);
        ui.strong("left out");
        if plan.left_out.is_empty() {
            ui.weak("nothing");
        }
        for left in &plan.left_out {
            let mut saved = String::new();
            if left.saved_bytes > 0 {
                saved = format!("; saves {}", crate::plan::megabytes(left.saved_bytes));
            }
            ui.label(RichText::new(format!("{} - {}{saved}", left.what, left.reason)).color(Color32::GRAY));
        }
    }

    /// One step: a bar for its time, and the buffers that it writes, to be clicked.
    fn step(&self, ui: &mut Ui, desk: &mut Desk, shown: &Shown, at: usize, name: &str, longest: f64) {
        let step = &shown.run_plan.steps[at];
        ui.horizontal(|ui| {
            // the plan that runs here has the same steps, and those that somebody looks at
            let own = shown.step_names.iter().position(|known| known == name);
            let ms = own.and_then(|own| shown.step_ms.get(&own)).copied();
            let (rect, response) = ui.allocate_exact_size(Vec2::new(64.0, 12.0), Sense::hover());
            ui.painter().rect_filled(rect, 2.0, Color32::from_gray(40));
            if let Some(ms) = ms {
                let share = if longest > 0.0 { (ms / longest) as f32 } else { 0.0 };
                let mut bar = rect;
                bar.set_width(rect.width() * share);
                ui.painter().rect_filled(bar, 2.0, Color32::from_rgb(90, 150, 220));
                response.on_hover_text(format!("{ms:.3} ms by itself"));
                ui.small(format!("{ms:>7.3} ms"));
            }
            let often = if step.often == Often::Once { "once" } else { "" };
            let label = ui.link(&step.label);
            ui.small(often);
            if label.on_hover_text("the kernel's source").clicked()
                && let Some(run) = step.run()
            {
                desk.act(Action::Source(run.kernel.name.clone()));
            }
            for id in written(step) {
                let buffer = shown.run_plan.buffer(id);
                let text = RichText::new(&buffer.name).color(Color32::from_rgb(150, 200, 130));
                let response =
                    ui.link(text).on_hover_text(format!("{}\nclick: see it after this step", buffer.meaning));
                if response.clicked() || response.middle_clicked() {
                    let last = last_writer(&shown.run_plan, &buffer.name) == Some(at);
                    let of = if last { buffer.name.clone() } else { format!("{}@{name}", buffer.name) };
                    let in_new = response.middle_clicked() || ui.input(|input| input.modifiers.command);
                    desk.act(Action::See { side: self.side, of: Of::Buffer(of), in_new });
                }
            }
        });
    }

    /// A column a buffer, a row a step.
    fn matrix(&self, ui: &mut Ui, desk: &mut Desk, shown: &Shown) {
        let plan = &shown.run_plan;
        let names = step_names(&plan.steps);
        let buffers: Vec<BufferId> = (0..plan.buffers.len()).map(BufferId).filter(|id| plan.lives(*id)).collect();
        ui.small("orange writes, blue reads, both both; click to see the buffer after the step");
        egui::Grid::new("matrix").striped(true).spacing([2.0, 1.0]).show(ui, |ui| {
            ui.label("");
            for &id in &buffers {
                ui.small(&plan.buffer(id).name).on_hover_text(&plan.buffer(id).meaning);
            }
            ui.end_row();
            for (at, step) in plan.steps.iter().enumerate() {
                ui.small(&names[at]);
                for &id in &buffers {
                    let reads = step.reads.contains(&id) || step.binds(id) && !step.writes.contains(&id);
                    let writes = step.writes.contains(&id);
                    let (rect, response) = ui.allocate_exact_size(Vec2::new(26.0, 13.0), Sense::click());
                    let half = rect.width() / 2.0;
                    let painter = ui.painter();
                    if reads {
                        let mut left = rect.shrink(1.0);
                        left.set_width(half - 1.0);
                        painter.rect_filled(left, 1.0, Color32::from_rgb(90, 150, 220));
                    }
                    if writes {
                        let mut right = rect.shrink(1.0);
                        right.min.x += half;
                        painter.rect_filled(right, 1.0, Color32::from_rgb(230, 150, 50));
                    }
                    if (reads || writes)
                        && response.on_hover_text(format!("{} - {}", names[at], plan.buffer(id).name)).clicked()
                    {
                        let of = format!("{}@{}", plan.buffer(id).name, names[at]);
                        let of = if step.run().is_some() { of } else { plan.buffer(id).name.clone() };
                        desk.act(Action::See { side: self.side, of: Of::Buffer(of), in_new: false });
                    }
                }
                ui.end_row();
            }
        });
    }
}

fn steps_of(plan: &Plan, stage_index: usize) -> Vec<usize> {
    (0..plan.steps.len()).filter(|&at| plan.steps[at].stage_index == stage_index).collect()
}

fn written(step: &Step) -> Vec<BufferId> {
    let mut written = step.writes.clone();
    written.dedup();
    written
}

fn last_writer(plan: &Plan, buffer: &str) -> Option<usize> {
    plan.steps.iter().rposition(|step| step.writes.iter().any(|id| plan.buffer(*id).name == buffer))
}
