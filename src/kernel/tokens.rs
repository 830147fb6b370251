//! The tokens of a WGSL text, as far as its nesting is concerned.

use std::ops::Range;

/// Operators of two characters.
const PAIRS: [&str; 19] =
    ["&&", "||", "==", "!=", "<=", ">=", "<<", ">>", "+=", "-=", "*=", "/=", "%=", "&=", "|=", "^=", "->", "++", "--"];

/// The byte ranges of all tokens; what stands in comments is none.
pub fn tokens(text: &str) -> impl Iterator<Item = Range<usize>> {
    let mut at = 0;
    std::iter::from_fn(move || {
        at += skipped(&text[at..]);
        let start = at;
        at += length(&text[at..]);
        (at > start).then_some(start..at)
    })
}

/// Bytes of white space and comments that a text begins with.
fn skipped(text: &str) -> usize {
    let mut rest = text;
    loop {
        let trimmed = rest.trim_start();
        rest = if trimmed.starts_with("//") {
            trimmed.find('\n').map_or("", |end| &trimmed[end..])
        } else if trimmed.starts_with("/*") {
            &trimmed[block_comment(trimmed)..]
        } else {
            return text.len() - trimmed.len();
        };
    }
}

/// Bytes of a block comment, in which others may stand.
fn block_comment(text: &str) -> usize {
    let (mut depth, mut at) = (0usize, 0);
    while at < text.len() {
        if text.as_bytes()[at..].starts_with(b"/*") {
            (depth, at) = (depth + 1, at + 2);
        } else if text.as_bytes()[at..].starts_with(b"*/") {
            (depth, at) = (depth - 1, at + 2);
            if depth == 0 {
                return at;
            }
        } else {
            at += 1;
        }
    }
    text.len()
}

/// Bytes of the token that a text begins with.
fn length(text: &str) -> usize {
    let is_word = |letter: char| letter.is_alphanumeric() || letter == '_';
    match text.chars().next() {
        None => 0,
        Some(first) if first.is_ascii_digit() => number(text),
        Some(first) if is_word(first) => text.find(|letter| !is_word(letter)).unwrap_or(text.len()),
        Some(_) if PAIRS.iter().any(|pair| text.starts_with(pair)) => 2,
        Some(first) => first.len_utf8(),
    }
}

/// Bytes of a number; the sign of its exponent is part of it.
fn number(text: &str) -> usize {
    let exponents: &[char] = if text.starts_with("0x") || text.starts_with("0X") { &['p', 'P'] } else { &['e', 'E'] };
    let mut before = ' ';
    let end = text.find(|letter: char| {
        let is_sign = matches!(letter, '+' | '-') && exponents.contains(&before);
        before = letter;
        !(letter.is_alphanumeric() || letter == '.' || is_sign)
    });
    end.unwrap_or(text.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_are_none_and_numbers_are_one() {
        let text = "a+=b1.x/* - /* * */ - */ <<1.5e-3f // - -\n -0xep+1-0xe+é;/* no end";
        let found: Vec<&str> = tokens(text).map(|token| &text[token]).collect();
        assert_eq!(found, ["a", "+=", "b1", ".", "x", "<<", "1.5e-3f", "-", "0xep+1", "-", "0xe", "+", "é", ";"]);
    }
}
