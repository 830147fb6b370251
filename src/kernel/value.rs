//! Values of parameters, and where they stand in a kernel's uniform structure.

use std::fmt;

use super::{Field, FieldKind};

/// The value of one parameter: a number or a vector of up to four.
#[derive(Clone, Copy, PartialEq)]
pub struct Value {
    pub kind: FieldKind,
    bits: [u32; 4],
}

impl Value {
    /// The numbers as they stand in memory.
    pub fn words(&self) -> &[u32] {
        &self.bits[..self.kind.components().min(4) as usize]
    }

    /// The value, if it is one whole number.
    pub fn whole(&self) -> Option<i64> {
        match self.kind {
            FieldKind::U32(1) => Some(self.bits[0].into()),
            FieldKind::I32(1) => Some((self.bits[0] as i32).into()),
            _ => None,
        }
    }

    /// Writes the value to where naga says that its field is.
    pub fn pack(&self, field: &Field, bytes: &mut [u8]) {
        let packed: &[u8] = bytemuck::cast_slice(self.words());
        let start = field.offset as usize;
        bytes[start..start + packed.len()].copy_from_slice(packed);
    }
}

/// As it would be written in Rust.
impl fmt::Debug for Value {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let words = self.words().iter();
        match self.kind {
            FieldKind::F32(_) => write!(f, "F32({:?})", words.map(|&bits| f32::from_bits(bits)).collect::<Vec<_>>()),
            FieldKind::U32(_) => write!(f, "U32({:?})", self.words()),
            FieldKind::I32(_) => write!(f, "I32({:?})", words.map(|&bits| bits as i32).collect::<Vec<_>>()),
        }
    }
}

macro_rules! value_from {
    ($scalar:ty, $kind:ident, $bits:expr) => {
        impl From<&[$scalar]> for Value {
            /// Of more than four numbers the first.
            fn from(numbers: &[$scalar]) -> Self {
                let numbers = &numbers[..numbers.len().min(4)];
                let mut bits = [0; 4];
                bits.iter_mut().zip(numbers).for_each(|(bits, number)| *bits = $bits(*number));
                Value { kind: FieldKind::$kind(numbers.len() as u32), bits }
            }
        }
        impl From<$scalar> for Value {
            fn from(number: $scalar) -> Self {
                Value::from(&[number][..])
            }
        }
        impl<const N: usize> From<[$scalar; N]> for Value {
            fn from(numbers: [$scalar; N]) -> Self {
                Value::from(&numbers[..])
            }
        }
    };
}
value_from!(f32, F32, f32::to_bits);
value_from!(u32, U32, |number| number);
value_from!(i32, I32, |number| number as u32);
