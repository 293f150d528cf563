// SPDX-License-Identifier: MIT OR Apache-2.0
//! Arrays of the graph. Elements are constants, or elements of vectors that the program computes.

use super::MAX_NUMBERS;
use super::onnx::Tensor;

/// ONNX's numbers of data types.
pub(super) const FLOAT: i32 = 1;
pub(super) const DOUBLE: i32 = 11;
pub(super) const HALF: i32 = 10;
pub(super) const BRAIN: i32 = 16;
pub(super) const BOOL: i32 = 9;
pub(super) const LONG: i32 = 7;
/// Integer types with their sizes in bytes, negative for signed types.
const WHOLE: [(i32, i32); 8] = [(2, 1), (3, -1), (4, 2), (5, -2), (6, -4), (LONG, -8), (12, 4), (13, 8)];

/// Element of an array.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Element {
    /// A constant, known while reading.
    Number(f64),
    /// Element of a computed vector.
    Of {
        /// Step that computes the vector.
        vector: usize,
        /// Index in the vector, from 0.
        at: usize,
    },
}

/// An array in row-major order.
#[derive(Clone, Debug)]
pub(super) struct Value {
    pub(super) dims: Vec<usize>,
    pub(super) elements: Vec<Element>,
    /// ONNX data type. Computed arrays are floats or booleans.
    pub(super) kind: i32,
}

/// Reads bytes of another file: name, offset, length.
pub type Files<'a> = &'a dyn Fn(&str, u64, usize) -> Result<Vec<u8>, String>;

/// Name of a type, for messages.
pub(super) fn type_name(number: i32) -> String {
    const NAMES: [&str; 17] = [
        "undefined",
        "float",
        "uint8",
        "int8",
        "uint16",
        "int16",
        "int32",
        "int64",
        "string",
        "bool",
        "float16",
        "double",
        "uint32",
        "uint64",
        "complex64",
        "complex128",
        "bfloat16",
    ];
    let name = usize::try_from(number).ok().and_then(|number| NAMES.get(number));
    name.map_or_else(|| format!("of type {number}"), |name| (*name).to_owned())
}

/// The type has a fraction.
pub(super) fn is_float(kind: i32) -> bool {
    [FLOAT, DOUBLE, HALF, BRAIN].contains(&kind)
}

/// Number of elements of a shape; an error above [`MAX_NUMBERS`].
pub(super) fn count(dims: &[usize]) -> Result<usize, String> {
    let count = dims.iter().try_fold(1_usize, |all, dim| all.checked_mul(*dim));
    match count {
        Some(count) if count <= MAX_NUMBERS => Ok(count),
        _ => Err(format!(
            "an array of shape {dims:?} has more than {MAX_NUMBERS} elements, and no machine has more words of data"
        )),
    }
}

impl Value {
    pub(super) fn new(dims: Vec<usize>, values: impl IntoIterator<Item = f64>, kind: i32) -> Value {
        Value { dims, elements: values.into_iter().map(Element::Number).collect(), kind }
    }

    /// An array of all elements of a computed vector.
    pub(super) fn computed(dims: Vec<usize>, vector: usize, kind: i32) -> Value {
        let count = dims.iter().product();
        Value { dims, elements: (0..count).map(|at| Element::Of { vector, at }).collect(), kind }
    }

    /// Numbers of a constant; `None` if an element is computed.
    pub(super) fn numbers(&self) -> Option<Vec<f64>> {
        let number =
            |element: &Element| if let Element::Number(value) = element { Some(*value) } else { None };
        self.elements.iter().map(number).collect()
    }

    pub(super) fn is_constant(&self) -> bool {
        self.elements.iter().all(|element| matches!(element, Element::Number(_)))
    }

    /// Numbers of a constant, if all are integers.
    pub(super) fn integers(&self) -> Option<Vec<i64>> {
        let whole = |value: &f64| (value.fract() == 0.0 && value.abs() < 9e15).then_some(*value as i64);
        self.numbers()?.iter().map(whole).collect()
    }

    /// Number of a constant with one element.
    pub(super) fn number(&self) -> Option<f64> {
        match self.elements[..] {
            [Element::Number(value)] => Some(value),
            _ => None,
        }
    }

    /// Array of the shape `dims` whose element at `place` is this array's element at `from(place)`.
    pub(super) fn rearranged(
        &self,
        dims: Vec<usize>,
        from: impl Fn(&[usize]) -> Vec<usize>,
    ) -> Result<Value, String> {
        let total = count(&dims)?;
        let mut place = vec![0; dims.len()];
        let mut elements = Vec::with_capacity(total);
        for _ in 0..total {
            let at = from(&place).iter().zip(&self.dims).fold(0, |at, (index, dim)| at * dim + index);
            elements.push(*self.elements.get(at).ok_or("a place lies outside the array")?);
            for axis in (0..dims.len()).rev() {
                place[axis] += 1;
                if place[axis] < dims[axis] {
                    break;
                }
                place[axis] = 0;
            }
        }
        Ok(Value { dims, elements, kind: self.kind })
    }

    /// Broadcasts to a shape that [`broadcast`] gave.
    pub(super) fn spread(&self, dims: &[usize]) -> Result<Value, String> {
        let skipped = dims.len() - self.dims.len();
        self.rearranged(dims.to_vec(), |place| {
            let place = place[skipped..].iter().zip(&self.dims);
            place.map(|(index, dim)| if *dim == 1 { 0 } else { *index }).collect()
        })
    }
}

/// Common shape of operands under ONNX's broadcasting rules.
pub(super) fn broadcast<'a>(shapes: impl Iterator<Item = &'a [usize]> + Clone) -> Result<Vec<usize>, String> {
    let rank = shapes.clone().map(<[usize]>::len).max().unwrap_or(0);
    let mut dims = vec![1; rank];
    for shape in shapes.clone() {
        for (all, dim) in dims[rank - shape.len()..].iter_mut().zip(shape) {
            if *all == 1 {
                *all = *dim;
            } else if *dim != 1 && *dim != *all {
                let shapes: Vec<String> = shapes.map(|shape| format!("{shape:?}")).collect();
                return Err(format!(
                    "its operands have the shapes {}, which do not fit",
                    shapes.join(" and ")
                ));
            }
        }
    }
    count(&dims)?;
    Ok(dims)
}

/// Decodes a binary16 number.
fn half(bits: u16) -> f64 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023));
    let size = match exponent {
        0 => fraction * 2_f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1024.0 + fraction) * 2_f64.powi(exponent - 25),
    };
    if bits >> 15 == 1 { -size } else { size }
}

fn brain(bits: u16) -> f64 {
    f64::from(f32::from_bits(u32::from(bits) << 16))
}

/// Decodes a little-endian integer.
fn whole(bytes: &[u8], signed: bool) -> f64 {
    let negative = signed && bytes.last().is_some_and(|byte| byte >> 7 == 1);
    let mut wide = if negative { [0xff; 16] } else { [0; 16] };
    wide[..bytes.len()].copy_from_slice(bytes);
    i128::from_le_bytes(wide) as f64
}

/// Decodes the numbers of a tensor.
pub(super) fn constant(tensor: &Tensor, files: Files<'_>) -> Result<Value, String> {
    let dims: Option<Vec<usize>> = tensor.dims.iter().map(|dim| usize::try_from(*dim).ok()).collect();
    let dims = dims.ok_or_else(|| format!("its shape is {:?}", tensor.dims))?;
    let count = count(&dims)?;
    let kind = tensor.data_type;
    let bytes = match kind {
        FLOAT => 4,
        DOUBLE => 8,
        HALF | BRAIN => 2,
        BOOL => 1,
        _ => match WHOLE.iter().find(|(known, _)| *known == kind) {
            Some((_, bytes)) => bytes.unsigned_abs() as usize,
            None => return Err(format!("its elements are {}; expected numbers", type_name(kind))),
        },
    };
    let elsewhere;
    let raw = if tensor.location == 1 {
        elsewhere = external(tensor, count * bytes, files)?;
        &elsewhere
    } else {
        &tensor.raw_data
    };
    let values: Vec<f64> = if raw.is_empty() {
        let small = || tensor.int32_data.iter();
        match kind {
            FLOAT => tensor.float_data.iter().copied().map(f64::from).collect(),
            DOUBLE => tensor.double_data.clone(),
            HALF => small().map(|bits| half(*bits as u16)).collect(),
            BRAIN => small().map(|bits| brain(*bits as u16)).collect(),
            LONG => tensor.int64_data.iter().map(|value| *value as f64).collect(),
            12 | 13 => tensor.uint64_data.iter().map(|value| *value as f64).collect(),
            _ => small().copied().map(f64::from).collect(),
        }
    } else {
        let signed = WHOLE.iter().any(|(known, bytes)| *known == kind && *bytes < 0);
        let words = raw.chunks_exact(bytes);
        let two = |word: &[u8]| u16::from_le_bytes([word[0], word[1]]);
        match kind {
            FLOAT => raw.as_chunks::<4>().0.iter().map(|word| f64::from(f32::from_le_bytes(*word))).collect(),
            DOUBLE => raw.as_chunks::<8>().0.iter().map(|word| f64::from_le_bytes(*word)).collect(),
            HALF => words.map(|word| half(two(word))).collect(),
            BRAIN => words.map(|word| brain(two(word))).collect(),
            _ => words.map(|word| whole(word, signed)).collect(),
        }
    };
    if values.len() != count {
        return Err(format!("it has {} numbers, and its shape {dims:?} needs {count}", values.len()));
    }
    Ok(Value::new(dims, values, kind))
}

/// Bytes of a tensor that lie in another file, in the model's folder or below.
fn external(tensor: &Tensor, bytes: usize, files: Files<'_>) -> Result<Vec<u8>, String> {
    let entry =
        |key: &str| tensor.external_data.iter().find(|entry| entry.key == key).map(|entry| &entry.value);
    let location = entry("location").ok_or("its numbers are in another file, whose name is missing")?;
    let steps: Vec<&str> = location.split(['/', '\\']).collect();
    let leaves =
        location.is_empty() || location.contains(':') || steps.iter().any(|step| matches!(*step, "" | ".."));
    if leaves {
        return Err(format!(
            "its numbers lie in `{location}`; the file must be in the folder of the model, or below it"
        ));
    }
    let whole = |key: &str, otherwise: u64| match entry(key).map(|text| text.parse::<u64>()) {
        None => Ok(otherwise),
        Some(Ok(value)) => Ok(value),
        Some(Err(_)) => Err(format!("`{key}` of its numbers in `{location}` is not a number")),
    };
    let (offset, length) = (whole("offset", 0)?, whole("length", bytes as u64)?);
    if length != bytes as u64 {
        return Err(format!(
            "its numbers need {bytes} bytes, but {length} are given for them in `{location}`"
        ));
    }
    let found = files(location, offset, bytes)?;
    if found.len() == bytes {
        return Ok(found);
    }
    Err(format!("`{location}` ends before its numbers do, which are {bytes} bytes from {offset} on"))
}
