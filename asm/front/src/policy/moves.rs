// SPDX-License-Identifier: MIT OR Apache-2.0
//! Operators that compute nothing: they reshape, select or convert elements.

use super::onnx::{Attribute, Node};
use super::tensor::{BOOL, Element, LONG, Value, broadcast, count, is_float, type_name};

/// Operands by position; `None` for one that is left out.
pub(super) type Operands<'a> = [Option<&'a Value>];

pub(super) fn attribute<'a>(node: &'a Node, name: &str) -> Option<&'a Attribute> {
    node.attributes.iter().find(|attribute| attribute.name == name)
}

pub(super) fn integer(node: &Node, name: &str, otherwise: i64) -> i64 {
    attribute(node, name).map_or(otherwise, |attribute| attribute.integer)
}

/// Resolves a negative axis; the result counts from 0.
pub(super) fn axis(axis: i64, rank: usize) -> Result<usize, String> {
    let rank = i64::try_from(rank).map_err(|error| error.to_string())?;
    match axis {
        0.. if axis < rank => Ok(axis as usize),
        _ if axis < 0 && axis + rank >= 0 => Ok((axis + rank) as usize),
        _ => Err(format!("it has no axis {axis}; its operand has {rank} dimensions")),
    }
}

/// Integers of a constant operand, if present, or of an attribute.
pub(super) fn integers(
    node: &Node,
    inputs: &Operands<'_>,
    position: usize,
    name: &str,
) -> Result<Option<Vec<i64>>, String> {
    match inputs.get(position).copied().flatten() {
        Some(value) => {
            value.integers().map(Some).ok_or_else(|| format!("`{name}` is computed, but must be a constant"))
        }
        None => Ok(attribute(node, name).map(|attribute| attribute.integers.clone())),
    }
}

/// Resolves axes, sorts them, and drops duplicates.
pub(super) fn axes(axes: &[i64], rank: usize) -> Result<Vec<usize>, String> {
    let mut axes = axes.iter().map(|axis| self::axis(*axis, rank)).collect::<Result<Vec<_>, _>>()?;
    axes.sort_unstable();
    axes.dedup();
    Ok(axes)
}

/// Results of an operator of this file; `None` for other operators.
pub(super) fn moved(node: &Node, inputs: &Operands<'_>) -> Result<Option<Vec<Value>>, String> {
    let first = || inputs.first().copied().flatten().ok_or_else(|| "it has no operand".to_owned());
    let one = |value: Result<Value, String>| value.map(|value| Some(vec![value]));
    match node.operator.as_str() {
        "Identity" | "Dropout" => one(first().cloned()),
        "Cast" => one(first().and_then(|x| cast(x, integer(node, "to", 1) as i32))),
        "CastLike" => {
            let kind = inputs.get(1).copied().flatten().ok_or("its second operand is missing")?.kind;
            one(first().and_then(|x| cast(x, kind)))
        }
        "Flatten" => one(first().and_then(|x| flatten(x, integer(node, "axis", 1)))),
        "Reshape" => {
            let shape = integers(node, inputs, 1, "shape")?.ok_or("it has no shape")?;
            one(first().and_then(|x| reshape(x, &shape, integer(node, "allowzero", 0) != 0)))
        }
        "Squeeze" => {
            let axes = integers(node, inputs, 1, "axes")?;
            one(first().and_then(|x| squeeze(x, axes.as_deref())))
        }
        "Unsqueeze" => {
            let axes = integers(node, inputs, 1, "axes")?.ok_or("it has no axes")?;
            one(first().and_then(|x| unsqueeze(x, &axes)))
        }
        "Transpose" => one(first().and_then(|x| {
            let rank = x.dims.len() as i64;
            let order = attribute(node, "perm").map(|order| order.integers.clone());
            transpose(x, &order.unwrap_or_else(|| (0..rank).rev().collect()))
        })),
        "Slice" => one(slice(node, inputs, first()?)),
        "Split" => split(node, inputs, first()?).map(Some),
        "Gather" => {
            let indices = inputs.get(1).copied().flatten().ok_or("it has no indices")?;
            one(gather(first()?, indices, integer(node, "axis", 0)))
        }
        "Concat" => one(concat(inputs, integer(node, "axis", 0))),
        "Expand" => {
            let shape = integers(node, inputs, 1, "shape")?.ok_or("it has no shape")?;
            one(first().and_then(|x| expand(x, &shape)))
        }
        "Shape" => {
            let dims = first()?.dims.iter().map(|dim| *dim as f64).collect::<Vec<_>>();
            one(Ok(Value::new(vec![dims.len()], dims, LONG)))
        }
        "ConstantOfShape" => {
            let shape = integers(node, inputs, 0, "shape")?.ok_or("it has no shape")?;
            one(filled(node, &shape))
        }
        _ => Ok(None),
    }
}

/// Converts to another type.
fn cast(x: &Value, to: i32) -> Result<Value, String> {
    if is_float(to) || to == x.kind || x.kind == BOOL {
        return Ok(Value { kind: to, ..x.clone() });
    }
    let Some(numbers) = x.numbers() else {
        return Err(format!("it converts computed values to {}; only floats are supported", type_name(to)));
    };
    let whole = |value: f64| if to == BOOL { f64::from(value != 0.0) } else { value.trunc() };
    Ok(Value::new(x.dims.clone(), numbers.into_iter().map(whole), to))
}

fn shaped(x: &Value, dims: Vec<usize>) -> Result<Value, String> {
    if count(&dims)? != x.elements.len() {
        return Err(format!("an array of shape {:?} cannot be given the shape {dims:?}", x.dims));
    }
    Ok(Value { dims, ..x.clone() })
}

fn flatten(x: &Value, at: i64) -> Result<Value, String> {
    let rank = x.dims.len();
    let at = if at == rank as i64 { rank } else { axis(at, rank.max(1))? };
    let rows: usize = x.dims[..at.min(rank)].iter().product();
    shaped(x, vec![rows, x.elements.len() / rows.max(1)])
}

fn reshape(x: &Value, shape: &[i64], zeros_count: bool) -> Result<Value, String> {
    let mut dims = Vec::new();
    for (index, dim) in shape.iter().enumerate() {
        dims.push(match *dim {
            0 if !zeros_count => {
                *x.dims.get(index).ok_or_else(|| format!("its new shape {shape:?} is invalid"))?
            }
            -1 => 1,
            dim => usize::try_from(dim).map_err(|_| format!("its new shape {shape:?} is invalid"))?,
        });
    }
    if let Some(open) = shape.iter().position(|dim| *dim == -1) {
        let rest = count(&dims)?;
        dims[open] = x.elements.len() / rest.max(1);
    }
    shaped(x, dims)
}

fn squeeze(x: &Value, given: Option<&[i64]>) -> Result<Value, String> {
    let rank = x.dims.len();
    let gone = match given {
        Some(given) => axes(given, rank)?,
        None => (0..rank).filter(|axis| x.dims[*axis] == 1).collect(),
    };
    let dims = (0..rank).filter(|axis| !gone.contains(axis)).map(|axis| x.dims[axis]).collect();
    shaped(x, dims)
}

fn unsqueeze(x: &Value, given: &[i64]) -> Result<Value, String> {
    let rank = x.dims.len() + given.len();
    let new = axes(given, rank)?;
    let mut old = x.dims.iter();
    let dims = (0..rank).map(|axis| if new.contains(&axis) { 1 } else { old.next().copied().unwrap_or(1) });
    shaped(x, dims.collect())
}

pub(super) fn transpose(x: &Value, order: &[i64]) -> Result<Value, String> {
    let rank = x.dims.len();
    let order = order.iter().map(|from| axis(*from, rank)).collect::<Result<Vec<_>, _>>()?;
    if axes(&order.iter().map(|axis| *axis as i64).collect::<Vec<_>>(), rank)?.len() != rank {
        return Err(format!("its order {order:?} is not a permutation of {rank} axes"));
    }
    let dims = order.iter().map(|from| x.dims[*from]).collect();
    x.rearranged(dims, |place| {
        let mut from = vec![0; rank];
        order.iter().zip(place).for_each(|(axis, index)| from[*axis] = *index);
        from
    })
}

fn slice(node: &Node, inputs: &Operands<'_>, x: &Value) -> Result<Value, String> {
    let rank = x.dims.len();
    let starts = integers(node, inputs, 1, "starts")?.ok_or("it has no starts")?;
    let ends = integers(node, inputs, 2, "ends")?.ok_or("it has no ends")?;
    let given = integers(node, inputs, 3, "axes")?.unwrap_or_else(|| (0..starts.len() as i64).collect());
    let steps = integers(node, inputs, 4, "steps")?.unwrap_or_else(|| vec![1; starts.len()]);
    if starts.len() != ends.len() || starts.len() != given.len() || starts.len() != steps.len() {
        return Err("its starts, ends, axes and steps differ in number".to_owned());
    }
    let mut ways: Vec<(i64, i64)> = vec![(0, 1); rank];
    let mut dims = x.dims.clone();
    for (index, given) in given.iter().enumerate() {
        let (axis, step) = (axis(*given, rank)?, steps[index]);
        let length = x.dims[axis] as i64;
        let at = |place: i64| if place < 0 { place.saturating_add(length) } else { place };
        let (low, high) = if step > 0 { (0, length) } else { (-1, length - 1) };
        let start = at(starts[index]).clamp(low.max(0), high);
        let end = at(ends[index]).clamp(low, high);
        if step == 0 {
            return Err("a step of it is 0".to_owned());
        }
        let way = if step > 0 { end - start } else { start - end };
        let size = step.unsigned_abs();
        dims[axis] = (way.max(0) as u64).div_ceil(size) as usize;
        ways[axis] = (start, step);
    }
    x.rearranged(dims, |place| {
        place
            .iter()
            .zip(&ways)
            .map(|(index, (start, step))| (start + step * *index as i64) as usize)
            .collect()
    })
}

/// The elements `from` to `from + length` along an axis.
fn part(x: &Value, axis: usize, from: usize, length: usize) -> Result<Value, String> {
    let mut dims = x.dims.clone();
    dims[axis] = length;
    x.rearranged(dims, |place| {
        let mut place = place.to_vec();
        place[axis] += from;
        place
    })
}

fn split(node: &Node, inputs: &Operands<'_>, x: &Value) -> Result<Vec<Value>, String> {
    let axis = axis(integer(node, "axis", 0), x.dims.len())?;
    let length = x.dims[axis];
    let lengths = match integers(node, inputs, 1, "split")? {
        Some(lengths) => {
            let lengths: Option<Vec<usize>> =
                lengths.iter().map(|length| usize::try_from(*length).ok()).collect();
            lengths.ok_or("one of its parts has a negative length")?
        }
        None => {
            // The last part may be shorter.
            let part = length.div_ceil(node.outputs.len().max(1));
            (0..node.outputs.len()).map(|index| part.min(length.saturating_sub(index * part))).collect()
        }
    };
    if lengths.iter().sum::<usize>() != length || lengths.len() < node.outputs.len() {
        return Err(format!("its parts have the lengths {lengths:?}, and its operand {length}"));
    }
    let mut from = 0;
    let mut parts = Vec::new();
    for length in lengths {
        parts.push(part(x, axis, from, length)?);
        from += length;
    }
    Ok(parts)
}

fn gather(x: &Value, indices: &Value, at: i64) -> Result<Value, String> {
    let axis = axis(at, x.dims.len())?;
    let found = indices.integers().ok_or("its indices are computed, but must be constants")?;
    let length = x.dims[axis] as i64;
    let at = |index: &i64| {
        let index = if *index < 0 { index + length } else { *index };
        usize::try_from(index)
            .ok()
            .filter(|_| index < length)
            .ok_or("an index of it lies outside its operand")
    };
    let found = found.iter().map(at).collect::<Result<Vec<usize>, _>>()?;
    let dims = [&x.dims[..axis], &indices.dims, &x.dims[axis + 1..]].concat();
    let rank = indices.dims.len();
    x.rearranged(dims, |place| {
        let inner =
            place[axis..axis + rank].iter().zip(&indices.dims).fold(0, |at, (index, dim)| at * dim + index);
        [&place[..axis], &[found[inner]], &place[axis + rank..]].concat()
    })
}

fn concat(inputs: &Operands<'_>, at: i64) -> Result<Value, String> {
    let parts: Vec<&Value> = inputs.iter().copied().flatten().collect();
    let first = parts.first().ok_or("it has no operand")?;
    let axis = axis(at, first.dims.len())?;
    let mut dims = first.dims.clone();
    dims[axis] = 0;
    for part in &parts {
        let others = |value: &Value| {
            [&value.dims[..axis.min(value.dims.len())], &value.dims[(axis + 1).min(value.dims.len())..]]
                .concat()
        };
        if part.dims.len() != dims.len() || others(part) != others(first) {
            return Err(format!(
                "its operands have the shapes {:?} and {:?}, which do not fit",
                first.dims, part.dims
            ));
        }
        dims[axis] += part.dims[axis];
    }
    let total = count(&dims)?;
    // Interleave runs of all parts, for each index of the dimensions before the axis.
    let outer: usize = dims[..axis].iter().product();
    let mut elements: Vec<Element> = Vec::with_capacity(total);
    for row in 0..outer {
        for part in &parts {
            let run = part.elements.len() / outer.max(1);
            elements.extend_from_slice(&part.elements[row * run..(row + 1) * run]);
        }
    }
    let kind = if parts.iter().any(|part| is_float(part.kind)) { first.kind } else { LONG };
    Ok(Value { dims, elements, kind })
}

fn expand(x: &Value, shape: &[i64]) -> Result<Value, String> {
    let shape: Option<Vec<usize>> = shape.iter().map(|dim| usize::try_from(*dim).ok()).collect();
    let shape = shape.ok_or("its shape has a negative dimension")?;
    let dims = broadcast([&x.dims[..], &shape].into_iter())?;
    x.spread(&dims)
}

fn filled(node: &Node, shape: &[i64]) -> Result<Value, String> {
    let dims: Option<Vec<usize>> = shape.iter().map(|dim| usize::try_from(*dim).ok()).collect();
    let dims = dims.ok_or("its shape has a negative dimension")?;
    let total = count(&dims)?;
    let (value, kind) = match attribute(node, "value").and_then(|attribute| attribute.tensor.as_ref()) {
        Some(tensor) => {
            let value =
                super::tensor::constant(tensor, &|_, _, _| Err("its value lies in another file".to_owned()))?;
            (value.number().ok_or("its value is not a number")?, value.kind)
        }
        None => (0.0, 1),
    };
    Ok(Value::new(dims, vec![value; total], kind))
}
