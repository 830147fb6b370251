//! The numbers in an element of a buffer, each by its name.

use crate::kernel::{Elem, Packing};
use crate::plan::Buffer;

/// How a number lies in its word; the numbers are those of `kernels/lib/look.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Kind {
    Float = 0,
    Unsigned = 1,
    Signed = 2,
    Half = 3,
    /// Red, green, blue, alpha.
    Colour = 4,
}

/// One number of an element.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    pub name: String,
    pub kind: Kind,
    /// u32 in an element, and the one in which the number is.
    pub words: u32,
    pub word: u32,
    /// The lowest bit of the number in the word, and the bits that are left of it.
    pub shift: u32,
    pub mask: u32,
    /// Negative numbers mean that nothing is there.
    pub is_missing_below_zero: bool,
}

/// What a number is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Number {
    Is(f64),
    /// Nothing is there.
    Missing,
}

/// All numbers of a buffer's elements; the first is what is shown at first.
pub fn channels(buffer: &Buffer) -> Vec<Channel> {
    let words = buffer.elem.components();
    let channel = |name: &str, kind, word, shift, mask| Channel {
        name: name.into(),
        kind,
        words,
        word,
        shift,
        mask,
        is_missing_below_zero: buffer.missing.is_some() && kind == Kind::Float,
    };
    let whole = |name: &str, kind, word| channel(name, kind, word, 0, u32::MAX);
    if !buffer.parts.is_empty() {
        let mask = |bits: u32| if bits >= 32 { u32::MAX } else { (1 << bits) - 1 };
        let part = |part: &crate::plan::spread::Part| {
            channel(part.name, Kind::Unsigned, part.word as u32, part.shift, mask(part.bits))
        };
        return buffer.parts.iter().map(part).collect();
    }
    match buffer.packing {
        Packing::Bytes => {
            let bytes = ["red", "green", "blue", "alpha"].iter().enumerate();
            let bytes = bytes.map(|(at, name)| channel(name, Kind::Unsigned, 0, 8 * at as u32, 0xff));
            std::iter::once(whole("colour", Kind::Colour, 0)).chain(bytes).collect()
        }
        Packing::Halves => vec![channel("x", Kind::Half, 0, 0, 0xffff), channel("y", Kind::Half, 0, 16, 0xffff)],
        Packing::None => {
            let names = &["x", "y", "z", "w"][..words as usize];
            let kind = match buffer.elem {
                elem if elem.is_float() => Kind::Float,
                Elem::I32 => Kind::Signed,
                _ => Kind::Unsigned,
            };
            let name = |name: &str| if words == 1 { "value".to_string() } else { name.to_string() };
            let plain = names.iter().enumerate().map(|(at, own)| whole(&name(own), kind, at as u32));
            let bits = names.iter().enumerate().filter(|_| kind == Kind::Unsigned);
            let bits = bits.map(|(at, own)| whole(&format!("{} as f32", name(own)), Kind::Float, at as u32));
            plain.chain(bits).collect()
        }
    }
}

impl Channel {
    /// The number in the words of one element.
    pub fn number(&self, words: &[u32]) -> Number {
        let word = words.get(self.word as usize).copied().unwrap_or_default();
        match self.kind {
            Kind::Float => {
                let value = f32::from_bits(word);
                let is_missing = self.is_missing_below_zero && value < 0.0;
                if is_missing { Number::Missing } else { Number::Is(value.into()) }
            }
            Kind::Signed => Number::Is(f64::from(word as i32)),
            Kind::Half => Number::Is(half::f16::from_bits((word >> self.shift) as u16).into()),
            Kind::Unsigned | Kind::Colour => Number::Is(f64::from((word >> self.shift) & self.mask)),
        }
    }

    /// The number in as many digits as it takes to have it back.
    pub fn text(&self, words: &[u32]) -> String {
        let word = words.get(self.word as usize).copied().unwrap_or_default();
        match (self.kind, self.number(words)) {
            (_, Number::Missing) => "missing".into(),
            (Kind::Float, _) => f32::from_bits(word).to_string(),
            (Kind::Half, _) => half::f16::from_bits((word >> self.shift) as u16).to_string(),
            (Kind::Colour, _) => format!("#{:02x}{:02x}{:02x}", word & 255, word >> 8 & 255, word >> 16 & 255),
            (_, Number::Is(value)) => value.to_string(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::spread::Part;

    fn buffer(elem: Elem) -> Buffer {
        Buffer::new("made", elem, &[2, 2], "", "")
    }

    fn texts(buffer: &Buffer, words: &[u32]) -> Vec<String> {
        channels(buffer).iter().map(|channel| format!("{} {}", channel.name, channel.text(words))).collect()
    }

    #[test]
    fn every_number_of_an_element_has_a_name_and_its_digits() {
        let one = 1.1_f32.to_bits();
        assert_eq!(texts(&buffer(Elem::F32), &[one]), ["value 1.1"]);
        assert_eq!(texts(&buffer(Elem::Vec2F32), &[one, 0]), ["x 1.1", "y 0"]);
        assert_eq!(texts(&buffer(Elem::I32), &[u32::MAX]), ["value -1"]);
        assert_eq!(texts(&buffer(Elem::U32), &[one]), [format!("value {one}"), "value as f32 1.1".into()]);
        let missing = Buffer { missing: Some(-1.0), ..buffer(Elem::F32) };
        assert_eq!(texts(&missing, &[(-2.0_f32).to_bits()]), ["value missing"]);
        let bytes = Buffer { packing: Packing::Bytes, ..buffer(Elem::U32) };
        assert_eq!(texts(&bytes, &[0xff03_0201])[..2], ["colour #010203", "red 1"]);
        let halves = Buffer { packing: Packing::Halves, ..buffer(Elem::U32) };
        assert_eq!(texts(&halves, &[0xc000_3c00]), ["x 1", "y -2"]);
        const PARTS: &[Part] = &[Part::new("row", 0, 16, 16), Part::new("level", 1, 1, 4)];
        let parts = Buffer { parts: PARTS, ..buffer(Elem::Vec2U32) };
        assert_eq!(texts(&parts, &[7 << 16, 0b11010]), ["row 7", "level 13"]);
    }
}
