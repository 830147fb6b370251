//! Values as text, row by row; only those that are seen are read.

use egui::Ui;

use super::image::{ask_rows, bytes_of};
use super::{Found, View};
use crate::inspector::desk::Desk;
use crate::inspector::probe::Where;
use crate::inspector::wish::Side;
use crate::look::channel::Kind;

/// Elements that were read, and those that are on their way.
#[derive(Default)]
pub struct Rows {
    have: Option<(Key, Vec<u32>)>,
    asked: Option<(u64, Key)>,
}

#[derive(Clone, Debug, PartialEq)]
struct Key {
    shown: u64,
    buffer: String,
    part: u32,
    first: (u32, u32),
    last: (u32, u32),
    stride: u32,
}

/// A rectangle of elements.
pub struct Block<'a> {
    key: &'a Key,
    words: &'a [u32],
}

impl Block<'_> {
    pub fn words(&self, column: u32, row: u32, words: usize) -> Option<&[u32]> {
        let Key { first, stride, .. } = self.key;
        let at = row.checked_sub(first.1)? as usize * *stride as usize + column.checked_sub(first.0)? as usize;
        self.words.get(at * words..(at + 1) * words)
    }
}

impl Rows {
    /// The elements from one corner to another, or those that were asked for before.
    pub fn of(
        &mut self,
        desk: &mut Desk,
        found: &Found,
        side: Side,
        first: (u32, u32),
        last: (u32, u32),
    ) -> Option<Block<'_>> {
        let key = Key {
            shown: desk.shown(side)?.number,
            buffer: found.held.about.name.clone(),
            part: found.part.row,
            first,
            last,
            stride: found.held.stride,
        };
        if let Some((number, asked)) = self.asked.clone()
            && let Some(answer) = desk.answer(number)
        {
            self.asked = None;
            self.have = bytes_of(answer).map(|bytes| (asked, bytemuck::pod_collect_to_vec(&bytes)));
        }
        let is_there = self.have.as_ref().is_some_and(|(have, _)| *have == key);
        if !is_there && self.asked.is_none() {
            self.asked = Some((ask_rows(desk, found, first, last), key));
        }
        let (have, words) = self.have.as_ref()?;
        (have.buffer == found.held.about.name).then_some(Block { key: have, words })
    }
}

impl View {
    pub(super) fn table(&mut self, ui: &mut Ui, desk: &mut Desk, found: &Found) {
        let (columns, rows) = found.held.size();
        let is_map = found.held.about.dims.len() == 2;
        // of a map, a line is a row of one number; of a list, an element with all of its numbers
        let lines = if is_map { rows } else { columns };
        let height = ui.text_style_height(&egui::TextStyle::Monospace);
        if lines == 0 {
            ui.weak("the list is empty");
            return;
        }
        egui::ScrollArea::both().id_salt(("table", self.id)).auto_shrink(false).show_rows(
            ui,
            height,
            lines as usize + 1,
            |ui, range| {
                let (from, to) = (range.start.saturating_sub(1) as u32, (range.end as u32).min(lines).max(1) - 1);
                let (first, last) =
                    if is_map { ((0, from), (columns - 1, to.max(from))) } else { ((from, 0), (to.max(from), 0)) };
                if range.start == 0 {
                    ui.monospace(self.header(found, is_map, columns));
                }
                let words = found.held.about.elem.components() as usize;
                let mut texts: Vec<(u32, String)> = Vec::new();
                if let Some(block) = self.live.rows.of(desk, found, self.side, first, last) {
                    for line in from..=to.max(from) {
                        let text = match is_map {
                            true => (0..columns.min(MOST_COLUMNS))
                                .filter_map(|column| block.words(column, line, words))
                                .map(|element| format!("{:>13}", short(&found.channel.text(element))))
                                .collect::<String>(),
                            false => match block.words(line, 0, words) {
                                Some(element) => numbers(found, element),
                                None => continue,
                            },
                        };
                        texts.push((line, text));
                    }
                }
                for (line, text) in texts {
                    let label = ui.monospace(format!("{line:>8} {text}"));
                    if label.hovered() && !is_map {
                        desk.pointer = Some((self.id, Where::Element(line, 0)));
                    }
                }
            },
        );
    }

    fn header(&self, found: &Found, is_map: bool, columns: u32) -> String {
        let names: String = match is_map {
            true => (0..columns.min(MOST_COLUMNS)).map(|column| format!("{column:>13}")).collect(),
            false => shown_channels(found).map(|channel| format!("{:>13}", channel.name)).collect(),
        };
        format!("{:>8} {names}", if is_map { "row" } else { "number" })
    }
}

/// All numbers of an element.
fn numbers(found: &Found, words: &[u32]) -> String {
    shown_channels(found).map(|channel| format!("{:>13}", short(&channel.text(words)))).collect()
}

/// Columns of a map that a line of the table has.
const MOST_COLUMNS: u32 = 512;

fn shown_channels(found: &Found) -> impl Iterator<Item = &crate::look::Channel> {
    found.channels.iter().filter(|channel| channel.kind != Kind::Colour)
}

/// Digits that fit a column.
fn short(text: &str) -> String {
    match text.len() {
        0..=12 => text.to_string(),
        _ => text.parse::<f64>().map_or(text[..12].to_string(), |number| format!("{number:.5e}")),
    }
}
