//! The part of a text that a message shows: the lines of a place, and of a long line only what is near it.

use std::ops::Range;

use codespan_reporting::files::{Error, Files, SimpleFile, column_index};

use super::diagnostic::Origin;

/// Columns of a line that is shown whole; a longer one would bury the message.
const WIDEST: usize = 400;
/// Columns that are shown of a longer line, and how many of them are in front of the place.
const SHOWN: usize = 160;
const BEFORE: usize = 40;

/// The lines of a place, with the numbers that they have in their file.
pub struct Excerpt<'a> {
    lines: SimpleFile<&'a str, String>,
    /// Lines of the file in front of them.
    lines_before: usize,
    /// How many columns each line lacks at its start.
    columns_before: Vec<usize>,
}

impl<'a> Excerpt<'a> {
    /// What is shown of a place, and where the place is in it.
    pub fn new(origin: &'a Origin) -> (Self, Range<usize>) {
        let text = &origin.source.text;
        let start = text.floor_char_boundary(origin.range.start);
        let end = text.floor_char_boundary(origin.range.end).max(start);
        let first = text[..start].rfind('\n').map_or(0, |at| at + 1);
        let last = text[end..].find('\n').map_or(text.len(), |at| end + at);
        let (mut shown, mut place, mut columns_before) = (String::new(), 0..0, Vec::new());
        let mut line_start = first;
        for line in text[first..last].split('\n') {
            let line_end = line_start + line.len();
            let focus = if line_start == first { start } else { end.min(line_end) };
            let part = near(line, focus - line_start);
            let open = if part.start > 0 { "…" } else { "" };
            let close = if part.end < line.len() { "…" } else { "" };
            let within = |at: usize| open.len() + (at - line_start).clamp(part.start, part.end) - part.start;
            if line_start == first {
                place.start = within(start);
            }
            place.end = shown.len() + within(end.min(line_end));
            columns_before.push(line[..part.start].chars().count() - open.chars().count());
            shown.extend([open, &line[part], close, "\n"]);
            line_start = line_end + 1;
        }
        let lines = SimpleFile::new(origin.source.name.as_str(), shown);
        (Self { lines, lines_before: text[..first].matches('\n').count(), columns_before }, place)
    }
}

/// The bytes of a line that are shown around a place in it.
fn near(line: &str, focus: usize) -> Range<usize> {
    let count = line.chars().count();
    if count <= WIDEST {
        return 0..line.len();
    }
    let from = line[..focus].chars().count().saturating_sub(BEFORE).min(count - SHOWN);
    let byte = |column: usize| line.char_indices().nth(column).map_or(line.len(), |(at, _)| at);
    byte(from)..byte(from + SHOWN)
}

/// The excerpts of a message, by their places in a list.
pub struct Excerpts<'a>(pub Vec<Excerpt<'a>>);

impl<'a> Excerpts<'a> {
    fn get(&self, id: usize) -> Result<&Excerpt<'a>, Error> {
        self.0.get(id).ok_or(Error::FileMissing)
    }
}

impl<'a> Files<'a> for Excerpts<'a> {
    type FileId = usize;
    type Name = &'a str;
    type Source = &'a str;

    fn name(&'a self, id: usize) -> Result<&'a str, Error> {
        Ok(self.get(id)?.lines.name())
    }

    fn source(&'a self, id: usize) -> Result<&'a str, Error> {
        Ok(self.get(id)?.lines.source())
    }

    fn line_index(&'a self, id: usize, byte_index: usize) -> Result<usize, Error> {
        self.get(id)?.lines.line_index((), byte_index)
    }

    fn line_range(&'a self, id: usize, line_index: usize) -> Result<Range<usize>, Error> {
        self.get(id)?.lines.line_range((), line_index)
    }

    fn line_number(&'a self, id: usize, line_index: usize) -> Result<usize, Error> {
        Ok(self.get(id)?.lines_before + line_index + 1)
    }

    fn column_number(&'a self, id: usize, line_index: usize, byte_index: usize) -> Result<usize, Error> {
        let excerpt = self.get(id)?;
        let column = column_index(self.source(id)?, self.line_range(id, line_index)?, byte_index);
        Ok(excerpt.columns_before.get(line_index).copied().unwrap_or(0) + column + 1)
    }
}
