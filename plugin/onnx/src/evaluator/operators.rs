//! Operators of ONNX graphs, in double precision.

use crate::{
    evaluator::{Elem, MOST_NUMBERS, Value, repeated},
    messages::NodeProto,
};

type Computed = Result<Vec<Value>, String>;

/// The most steps of a loop over a convolution or a product: any more are a damaged file.
const MOST_PRODUCTS: usize = 1 << 36;

/// Computes the outputs of a node.
pub(super) fn apply(node: &NodeProto, inputs: &[Option<&Value>], opset: i64) -> Computed {
    let given = |at: usize| inputs.get(at).copied().flatten();
    let input = |at: usize| given(at).ok_or_else(|| format!("its input {at} is missing"));
    let one = |value: Value| Ok(vec![value]);
    let each = |function: fn(f64) -> f64| {
        let x = input(0)?;
        one(Value { numbers: x.numbers.iter().map(|&x| function(x)).collect(), ..x.clone() })
    };
    let pairs = |function: fn(f64, f64) -> f64| one(broadcast(input(0)?, input(1)?, function)?);
    let compared =
        |function: fn(f64, f64) -> f64| one(Value { elem: Elem::Flag, ..broadcast(input(0)?, input(1)?, function)? });
    match node.op_type.as_str() {
        "Identity" | "Dropout" => one(input(0)?.clone()),
        "Cast" => {
            let elem = Elem::of(node.int("to", 0) as i32).ok_or("it casts to an unknown type")?;
            one(Value { elem, ..input(0)?.clone() })
        }
        "Relu" => each(|x| if x > 0.0 || x.is_nan() { x } else { 0.0 }),
        "Tanh" => each(libm::tanh),
        "Sigmoid" => each(sigmoid),
        "Exp" => each(libm::exp),
        "Log" => each(libm::log),
        "Sqrt" => each(f64::sqrt),
        "Neg" => each(|x| -x),
        "Abs" => each(f64::abs),
        "Reciprocal" => each(|x| 1.0 / x),
        "Add" => pairs(|a, b| a + b),
        "Sub" => pairs(|a, b| a - b),
        "Mul" => pairs(|a, b| a * b),
        "Div" if matches!(input(0)?.elem, Elem::Whole | Elem::Byte) => {
            if input(1)?.numbers.contains(&0.0) {
                return Err("it divides by zero".to_owned());
            }
            pairs(|a, b| (a / b).trunc())
        }
        "Div" => pairs(|a, b| a / b),
        "Pow" => pairs(libm::pow),
        "Max" => fold(inputs, f64::max),
        "Min" => fold(inputs, f64::min),
        "Greater" => compared(|a, b| f64::from(u8::from(a > b))),
        "Less" => compared(|a, b| f64::from(u8::from(a < b))),
        "Equal" => compared(|a, b| f64::from(u8::from(a == b))),
        "Where" => {
            let (condition, a, b) = (input(0)?, input(1)?, input(2)?);
            let chosen = broadcast(condition, a, |c, a| if c != 0.0 { a } else { f64::NAN })?;
            let other = broadcast(condition, b, |c, b| if c != 0.0 { f64::NAN } else { b })?;
            let both = broadcast(&chosen, &other, |a, b| if a.is_nan() { b } else { a })?;
            one(Value { elem: a.elem, ..both })
        }
        "Clip" => {
            let x = input(0)?;
            let bound = |at: usize, name: &str, otherwise: f64| match given(at) {
                Some(bound) => bound.numbers.first().copied().unwrap_or(otherwise),
                None => node.attribute(name).map_or(otherwise, |attribute| f64::from(attribute.f)),
            };
            let (low, high) = (bound(1, "min", f64::NEG_INFINITY), bound(2, "max", f64::INFINITY));
            one(Value { numbers: x.numbers.iter().map(|x| x.max(low).min(high)).collect(), ..x.clone() })
        }
        "Shape" => {
            let x = input(0)?;
            let (start, end) = (node.int("start", 0), node.int("end", i64::MAX));
            let rank = x.shape.len() as i64;
            let place = |at: i64| if at < 0 { at + rank } else { at }.clamp(0, rank) as usize;
            let sizes = x.shape.get(place(start)..place(end)).unwrap_or_default();
            one(wholes(sizes.iter().map(|&size| size as f64).collect()))
        }
        "Reshape" => {
            let (x, sizes) = (input(0)?, input(1)?.wholes());
            let keeps_zero = node.int("allowzero", 0) == 0;
            let mut shape = Vec::new();
            for (axis, &size) in sizes.iter().enumerate() {
                shape.push(match size {
                    0 if keeps_zero => x.shape.get(axis).copied().ok_or("it keeps an axis that is not there")?,
                    -1 => 0,
                    size => usize::try_from(size).map_err(|_| format!("it has the size {size}"))?,
                });
            }
            if let Some(free) = sizes.iter().position(|&size| size == -1) {
                let others = shape.iter().enumerate().filter(|(axis, _)| *axis != free);
                let others = others.fold(1_usize, |all, (_, &size)| all.saturating_mul(size));
                shape[free] = x.numbers.len().checked_div(others).unwrap_or(0);
            }
            one(reshaped(x, shape)?)
        }
        "Flatten" => {
            let x = input(0)?;
            let axis = axis_of(node.int("axis", 1), x.shape.len() + 1)?;
            let first: usize = x.shape.iter().take(axis).product();
            one(reshaped(x, vec![first, x.numbers.len().checked_div(first).unwrap_or(0)])?)
        }
        "Squeeze" => {
            let x = input(0)?;
            let axes = axes(node, given(1), x.shape.len())?;
            let is_gone = |axis: usize| axes.as_ref().map_or(x.shape[axis] == 1, |axes| axes.contains(&axis));
            let shape = (0..x.shape.len()).filter(|&axis| !is_gone(axis)).map(|axis| x.shape[axis]).collect();
            one(reshaped(x, shape)?)
        }
        "Unsqueeze" => {
            let x = input(0)?;
            let count = given(1).map_or_else(|| node.ints("axes").map_or(0, <[i64]>::len), |axes| axes.numbers.len());
            let axes = axes(node, given(1), x.shape.len() + count)?.unwrap_or_default();
            let mut sizes = x.shape.iter();
            let size = |axis: usize| if axes.contains(&axis) { Some(1) } else { sizes.next().copied() };
            one(reshaped(x, (0..x.shape.len() + count).filter_map(size).collect())?)
        }
        "Transpose" => {
            let x = input(0)?;
            let rank = x.shape.len();
            let order: Vec<usize> = match node.ints("perm") {
                Some(order) => order.iter().map(|&axis| axis_of(axis, rank)).collect::<Result<_, _>>()?,
                None => (0..rank).rev().collect(),
            };
            if (0..rank).any(|axis| !order.contains(&axis)) || order.len() != rank {
                return Err("it permutes other axes than those of its input".to_owned());
            }
            let shape: Vec<usize> = order.iter().map(|&axis| x.shape[axis]).collect();
            let strides = strides(&x.shape);
            let of = |place: &[usize]| place.iter().zip(&order).map(|(&at, &axis)| at * strides[axis]).sum();
            one(gather(x, shape, of))
        }
        "Concat" => {
            let parts: Vec<&Value> = inputs.iter().copied().flatten().collect();
            one(concat(&parts, node.int("axis", 0))?)
        }
        "Slice" => slice(node, inputs).and_then(one),
        "Split" => split(node, inputs),
        "Gather" => {
            let (x, index) = (input(0)?, input(1)?);
            let axis = axis_of(node.int("axis", 0), x.shape.len())?;
            let size = x.shape[axis] as i64;
            let rows: Vec<i64> = index.wholes().into_iter().map(|i| if i < 0 { i + size } else { i }).collect();
            if rows.iter().any(|&row| !(0..size).contains(&row)) {
                return Err(format!("it gathers beyond the {size} numbers of an axis"));
            }
            let (before, after) = (&x.shape[..axis], &x.shape[axis + 1..]);
            let inner: usize = after.iter().product();
            let outer: usize = before.iter().product();
            let mut numbers = Vec::with_capacity(outer * rows.len() * inner);
            for at in 0..outer {
                for &row in &rows {
                    let start = (at * x.shape[axis] + row as usize) * inner;
                    numbers.extend_from_slice(&x.numbers[start..start + inner]);
                }
            }
            let shape = [before, &index.shape, after].concat();
            one(Value { elem: x.elem, shape, numbers })
        }
        "Expand" => {
            let (x, sizes) = (input(0)?, input(1)?);
            let (shape, count) = sizes_of(sizes)?;
            let ones = Value { elem: x.elem, shape, numbers: vec![1.0; count] };
            one(broadcast(x, &ones, |x, _| x)?)
        }
        "ConstantOfShape" => {
            let (shape, count) = sizes_of(input(0)?)?;
            let value = repeated(node)?;
            let number = value.numbers.first().copied().unwrap_or_default();
            one(Value { elem: value.elem, shape, numbers: vec![number; count] })
        }
        "MatMul" => one(matmul(input(0)?, input(1)?)?),
        "Gemm" => one(gemm(node, inputs)?),
        "Conv" => one(conv(node, inputs)?),
        "MaxPool" => one(max_pool(node, input(0)?)?),
        "GRU" => gru(node, inputs),
        "Softmax" | "LogSoftmax" => {
            let x = input(0)?;
            let axis = axis_of(node.int("axis", if opset < 13 { 1 } else { -1 }), x.shape.len())?;
            let is_log = node.op_type == "LogSoftmax";
            one(along(x, axis, |row| {
                let logarithm = log_sum_exp(row);
                row.iter().map(|x| if is_log { x - logarithm } else { libm::exp(x - logarithm) }).collect()
            }))
        }
        "ReduceSum" => reduced(node, inputs, |row| row.iter().sum()),
        "ReduceMean" => reduced(node, inputs, |row| row.iter().sum::<f64>() / row.len().max(1) as f64),
        "ReduceMax" => reduced(node, inputs, |row| row.iter().copied().fold(f64::NEG_INFINITY, f64::max)),
        "ReduceLogSumExp" => reduced(node, inputs, log_sum_exp),
        "ArgMax" => {
            let x = input(0)?;
            let axis = axis_of(node.int("axis", 0), x.shape.len())?;
            let takes_last = node.int("select_last_index", 0) == 1;
            let best = along(x, axis, |row| {
                let largest = row.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                let is_largest = |x: &f64| *x == largest;
                let at = if takes_last { row.iter().rposition(is_largest) } else { row.iter().position(is_largest) };
                vec![at.unwrap_or_default() as f64]
            });
            let mut shape = best.shape;
            if node.int("keepdims", 1) == 0 {
                shape.remove(axis);
            }
            one(Value { elem: Elem::Whole, shape, numbers: best.numbers })
        }
        other => Err(format!("the operator {other} is unknown")),
    }
}

/// Returns sizes and their product, which is not too large.
fn sizes_of(sizes: &Value) -> Result<(Vec<usize>, usize), String> {
    let shape: Vec<usize> = sizes.numbers.iter().map(|&size| size as usize).collect();
    let count = shape.iter().try_fold(1_usize, |count, &size| count.checked_mul(size));
    let count = count.filter(|count| *count <= MOST_NUMBERS);
    count.map(|count| (shape, count)).ok_or_else(|| "its result has too many numbers".to_owned())
}

fn wholes(numbers: Vec<f64>) -> Value {
    Value { elem: Elem::Whole, shape: vec![numbers.len()], numbers }
}

fn sigmoid(x: f64) -> f64 {
    1.0 / (1.0 + libm::exp(-x))
}

fn log_sum_exp(row: &[f64]) -> f64 {
    let largest = row.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    largest + libm::log(row.iter().map(|x| libm::exp(x - largest)).sum())
}

fn axis_of(axis: i64, rank: usize) -> Result<usize, String> {
    let found = if axis < 0 { axis + rank as i64 } else { axis };
    usize::try_from(found).ok().filter(|found| *found < rank).ok_or_else(|| format!("it has no axis {axis}"))
}

/// Returns the axes of an input or of the attribute `axes`; `None` without any.
fn axes(node: &NodeProto, input: Option<&Value>, rank: usize) -> Result<Option<Vec<usize>>, String> {
    let axes = input.map(Value::wholes).or_else(|| node.ints("axes").map(<[i64]>::to_vec));
    let axes: Option<Result<Vec<usize>, String>> =
        axes.map(|axes| axes.into_iter().map(|axis| axis_of(axis, rank)).collect());
    let mut axes = axes.transpose()?;
    if let Some(axes) = &mut axes {
        axes.sort_unstable();
        axes.dedup();
    }
    Ok(axes)
}

fn strides(shape: &[usize]) -> Vec<usize> {
    let mut strides = vec![1; shape.len()];
    for axis in (1..shape.len()).rev() {
        strides[axis - 1] = strides[axis] * shape[axis];
    }
    strides
}

fn reshaped(x: &Value, shape: Vec<usize>) -> Result<Value, String> {
    let numbers = x.numbers.clone();
    let text = format!("{} numbers do not fill the sizes {shape:?}", numbers.len());
    Value::new(x.elem, shape, numbers).ok_or(text)
}

/// Returns the value of this shape whose number at each place is that of `x` at `of(place)`.
fn gather(x: &Value, shape: Vec<usize>, of: impl Fn(&[usize]) -> usize) -> Value {
    let count: usize = shape.iter().product();
    let mut place = vec![0; shape.len()];
    let mut numbers = Vec::with_capacity(count);
    for _ in 0..count {
        numbers.push(x.numbers[of(&place)]);
        for axis in (0..shape.len()).rev() {
            place[axis] += 1;
            if place[axis] < shape[axis] {
                break;
            }
            place[axis] = 0;
        }
    }
    Value { elem: x.elem, shape, numbers }
}

/// Combines numbers pair by pair; axes of size 1 repeat.
fn broadcast(a: &Value, b: &Value, function: impl Fn(f64, f64) -> f64) -> Result<Value, String> {
    let rank = a.shape.len().max(b.shape.len());
    let padded = |x: &Value| [vec![1; rank - x.shape.len()], x.shape.clone()].concat();
    let (of_a, of_b) = (padded(a), padded(b));
    let mut shape = Vec::with_capacity(rank);
    for (&a, &b) in of_a.iter().zip(&of_b) {
        shape.push(match (a, b) {
            (a, b) if a == b => a,
            (1, b) => b,
            (a, 1) => a,
            _ => return Err(format!("the sizes {of_a:?} and {of_b:?} do not go together")),
        });
    }
    if shape.iter().try_fold(1_usize, |all, &size| all.checked_mul(size)).is_none_or(|all| all > MOST_NUMBERS) {
        return Err("its result has too many numbers".to_owned());
    }
    let index = |sizes: &[usize]| {
        let strides = strides(sizes);
        let strides: Vec<usize> =
            sizes.iter().zip(strides).map(|(&size, stride)| if size == 1 { 0 } else { stride }).collect();
        move |place: &[usize]| place.iter().zip(&strides).map(|(at, stride)| at * stride).sum::<usize>()
    };
    let a_all = gather(a, shape.clone(), index(&of_a));
    let b_all = gather(b, shape, index(&of_b));
    let numbers = a_all.numbers.iter().zip(&b_all.numbers).map(|(&a, &b)| function(a, b)).collect();
    Ok(Value { numbers, ..a_all })
}

fn fold(inputs: &[Option<&Value>], function: fn(f64, f64) -> f64) -> Computed {
    let mut inputs = inputs.iter().copied().flatten();
    let first = inputs.next().ok_or("it has no input")?.clone();
    let all = inputs.try_fold(first, |all, next| broadcast(&all, next, function))?;
    Ok(vec![all])
}

/// Replaces the numbers along an axis by those that `function` returns for them, always as many.
fn along(x: &Value, axis: usize, function: impl Fn(&[f64]) -> Vec<f64>) -> Value {
    let size = x.shape[axis];
    let inner: usize = x.shape[axis + 1..].iter().product();
    let outer: usize = x.shape[..axis].iter().product();
    let mut rows = Vec::with_capacity(outer * inner);
    for at in 0..outer {
        for within in 0..inner {
            let row: Vec<f64> = (0..size).map(|i| x.numbers[(at * size + i) * inner + within]).collect();
            rows.push(function(&row));
        }
    }
    let width = rows.first().map_or(0, Vec::len);
    let mut numbers = Vec::with_capacity(rows.len() * width);
    for of_outer in rows.chunks(inner.max(1)) {
        for i in 0..width {
            numbers.extend(of_outer.iter().map(|row| row[i]));
        }
    }
    let mut shape = x.shape.clone();
    shape[axis] = width;
    Value { elem: x.elem, shape, numbers }
}

fn reduced(node: &NodeProto, inputs: &[Option<&Value>], function: impl Fn(&[f64]) -> f64) -> Computed {
    let x = inputs.first().copied().flatten().ok_or("its input 0 is missing")?;
    let rank = x.shape.len();
    let axes = axes(node, inputs.get(1).copied().flatten(), rank)?.filter(|axes| !axes.is_empty());
    let axes = match axes {
        Some(axes) => axes,
        None if node.int("noop_with_empty_axes", 0) == 1 => return Ok(vec![x.clone()]),
        None => (0..rank).collect(),
    };
    // The axes that go away come last, so that a row is what is reduced.
    let kept: Vec<usize> = (0..rank).filter(|axis| !axes.contains(axis)).collect();
    let order = [kept.clone(), axes.clone()].concat();
    let strides = strides(&x.shape);
    let shape = order.iter().map(|&axis| x.shape[axis]).collect();
    let of = |place: &[usize]| place.iter().zip(&order).map(|(&at, &axis)| at * strides[axis]).sum();
    let rows = gather(x, shape, of);
    let width: usize = axes.iter().map(|&axis| x.shape[axis]).product();
    let numbers = rows.numbers.chunks(width.max(1)).map(function).collect();
    let shape = match node.int("keepdims", 1) {
        0 => kept.iter().map(|&axis| x.shape[axis]).collect(),
        _ => (0..rank).map(|axis| if axes.contains(&axis) { 1 } else { x.shape[axis] }).collect(),
    };
    Ok(vec![Value { elem: x.elem, shape, numbers }])
}

fn concat(parts: &[&Value], axis: i64) -> Result<Value, String> {
    let first = parts.first().ok_or("it has no input")?;
    let axis = axis_of(axis, first.shape.len())?;
    let same = |part: &&Value| {
        let others = |x: &Value| [&x.shape[..axis], &x.shape[axis + 1..]].concat();
        part.shape.len() == first.shape.len() && others(part) == others(first)
    };
    if !parts.iter().all(same) {
        return Err("it joins values of different sizes".to_owned());
    }
    let outer: usize = first.shape[..axis].iter().product();
    let mut numbers = Vec::new();
    for at in 0..outer {
        for part in parts {
            let width = part.numbers.len() / outer.max(1);
            numbers.extend_from_slice(&part.numbers[at * width..(at + 1) * width]);
        }
    }
    let mut shape = first.shape.clone();
    shape[axis] = parts.iter().map(|part| part.shape[axis]).sum();
    Ok(Value { elem: first.elem, shape, numbers })
}

fn slice(node: &NodeProto, inputs: &[Option<&Value>]) -> Result<Value, String> {
    let x = inputs.first().copied().flatten().ok_or("its input 0 is missing")?;
    let list = |at: usize, name: &str| {
        let input = inputs.get(at).copied().flatten().map(Value::wholes);
        input.or_else(|| node.ints(name).map(<[i64]>::to_vec))
    };
    let (starts, ends) = (list(1, "starts").ok_or("it has no starts")?, list(2, "ends").ok_or("it has no ends")?);
    let axes = list(3, "axes").unwrap_or_else(|| (0..starts.len() as i64).collect());
    let steps = list(4, "steps").unwrap_or_else(|| vec![1; starts.len()]);
    let mut ranges: Vec<(usize, usize)> = x.shape.iter().map(|&size| (0, size)).collect();
    for (((&start, &end), &axis), &step) in starts.iter().zip(&ends).zip(&axes).zip(&steps) {
        let axis = axis_of(axis, x.shape.len())?;
        if step != 1 {
            return Err("it takes steps other than 1".to_owned());
        }
        let size = x.shape[axis] as i64;
        let place = |at: i64| if at < 0 { at.saturating_add(size) } else { at }.clamp(0, size) as usize;
        ranges[axis] = (place(start), place(end).max(place(start)));
    }
    let strides = strides(&x.shape);
    let shape = ranges.iter().map(|(start, end)| end - start).collect();
    let of = |place: &[usize]| {
        place.iter().zip(&ranges).zip(&strides).map(|((at, (start, _)), stride)| (at + start) * stride).sum()
    };
    Ok(gather(x, shape, of))
}

fn split(node: &NodeProto, inputs: &[Option<&Value>]) -> Computed {
    let x = inputs.first().copied().flatten().ok_or("its input 0 is missing")?;
    let axis = axis_of(node.int("axis", 0), x.shape.len())?;
    let size = x.shape[axis];
    let given = inputs.get(1).copied().flatten().map(Value::wholes).or_else(|| node.ints("split").map(<[i64]>::to_vec));
    let sizes: Vec<usize> = match given {
        Some(sizes) => sizes.iter().map(|&size| usize::try_from(size).unwrap_or(usize::MAX)).collect(),
        None => {
            let count = node.output.len().max(1);
            let part = size.div_ceil(count);
            (0..count).map(|at| part.min(size.saturating_sub(at * part))).collect()
        }
    };
    if sizes.iter().try_fold(0_usize, |sum, &size| sum.checked_add(size)) != Some(size) {
        return Err("its parts are not the whole".to_owned());
    }
    let strides = strides(&x.shape);
    let mut first = 0;
    let parts = sizes.into_iter().map(|part| {
        let mut shape = x.shape.clone();
        shape[axis] = part;
        let offset = first * strides[axis];
        first += part;
        gather(x, shape, |place| place.iter().zip(&strides).map(|(at, stride)| at * stride).sum::<usize>() + offset)
    });
    Ok(parts.collect())
}

/// Multiplies `[…, n, k]` by `[k, m]`, or vectors as such matrices.
fn matmul(a: &Value, b: &Value) -> Result<Value, String> {
    let wrong = || format!("matrices of sizes {:?} and {:?} cannot be multiplied", a.shape, b.shape);
    let [k, m] = b.shape[..] else { return Err(wrong()) };
    let (Some(&inner), rows) = (a.shape.last(), a.numbers.len().checked_div(k).unwrap_or(0)) else {
        return Err(wrong());
    };
    if inner != k || rows.saturating_mul(k).saturating_mul(m) > MOST_PRODUCTS {
        return Err(wrong());
    }
    let mut shape = a.shape.clone();
    shape.pop();
    shape.push(m);
    Ok(Value { elem: a.elem, shape, numbers: product(&a.numbers, &b.numbers, k, m) })
}

fn product(a: &[f64], b: &[f64], k: usize, m: usize) -> Vec<f64> {
    let mut out = vec![0.0; a.len().checked_div(k).unwrap_or(0) * m];
    for (row, to) in a.chunks_exact(k.max(1)).zip(out.chunks_exact_mut(m.max(1))) {
        for (x, weights) in row.iter().zip(b.chunks_exact(m.max(1))) {
            to.iter_mut().zip(weights).for_each(|(to, w)| *to += x * w);
        }
    }
    out
}

/// Returns a matrix with its axes swapped.
pub(crate) fn transposed(numbers: &[f64], rows: usize, columns: usize) -> Vec<f64> {
    (0..columns).flat_map(|c| (0..rows).map(move |r| (r, c))).map(|(r, c)| numbers[r * columns + c]).collect()
}

fn gemm(node: &NodeProto, inputs: &[Option<&Value>]) -> Result<Value, String> {
    let given = |at: usize| inputs.get(at).copied().flatten();
    let matrix = |at: usize, name: &str| {
        let x = given(at).ok_or_else(|| format!("its input {at} is missing"))?;
        let [rows, columns] = x.shape[..] else { return Err(format!("its input {at} is no matrix: {:?}", x.shape)) };
        Ok(match node.int(name, 0) {
            0 => x.clone(),
            _ => Value { elem: x.elem, shape: vec![columns, rows], numbers: transposed(&x.numbers, rows, columns) },
        })
    };
    let (alpha, beta) = (f64::from(node.float("alpha", 1.0)), f64::from(node.float("beta", 1.0)));
    let mut out = matmul(&matrix(0, "transA")?, &matrix(1, "transB")?)?;
    out.numbers.iter_mut().for_each(|x| *x *= alpha);
    match given(2) {
        None => Ok(out),
        Some(bias) => broadcast(&out, bias, |x, b| x + beta * b),
    }
}

/// A square window that moves over an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Window {
    pub(crate) side: usize,
    pub(crate) stride: usize,
    pub(crate) pad: usize,
}

impl Window {
    /// Reads the window of a node, with a kernel of `side` unless the node says otherwise.
    pub(crate) fn of(node: &NodeProto, side: Option<usize>) -> Result<Self, String> {
        let same = |name: &str, default: usize| -> Result<usize, String> {
            let Some(sizes) = node.ints(name).filter(|sizes| !sizes.is_empty()) else { return Ok(default) };
            let first = usize::try_from(sizes[0]).map_err(|_| format!("its `{name}` are negative"))?;
            match sizes.iter().all(|size| *size == sizes[0]) {
                true => Ok(first),
                false => Err(format!("its `{name}` differ from axis to axis: {sizes:?}")),
            }
        };
        if same("dilations", 1)? != 1 || node.int("group", 1) != 1 || node.int("ceil_mode", 0) != 0 {
            return Err("it has dilations, groups or rounds sizes up".to_owned());
        }
        match node.text("auto_pad").as_str() {
            "" | "NOTSET" | "VALID" => {}
            other => return Err(format!("its padding is `{other}`: write `pads`")),
        }
        let side = same("kernel_shape", side.unwrap_or(0))?;
        let window = Self { side, stride: same("strides", 1)?, pad: same("pads", 0)? };
        match window.stride == 0 || window.pad >= window.side {
            true => Err("its kernel has no size, or less than its padding".to_owned()),
            false => Ok(window),
        }
    }

    fn places(self, size: usize) -> Result<usize, String> {
        let whole = size.saturating_add(self.pad.saturating_mul(2));
        let places = whole.checked_sub(self.side).map(|rest| rest / self.stride + 1);
        places.ok_or_else(|| format!("its kernel of {} is larger than {size} pixels", self.side))
    }
}

fn image(x: &Value) -> Result<[usize; 4], String> {
    x.shape[..].try_into().map_err(|_| format!("it reads no images: {:?}", x.shape))
}

fn conv(node: &NodeProto, inputs: &[Option<&Value>]) -> Result<Value, String> {
    let given = |at: usize| inputs.get(at).copied().flatten();
    let (x, w) = (given(0).ok_or("its input is missing")?, given(1).ok_or("its weights are missing")?);
    let ([n, channels, height, width], [outputs, inputs, side, other]) = (image(x)?, image(w)?);
    let window = Window::of(node, Some(side))?;
    if inputs != channels || side != other || window.side != side {
        return Err(format!("its weights {:?} do not fit its input {:?}", w.shape, x.shape));
    }
    let (rows, columns) = (window.places(height)?, window.places(width)?);
    let bias = given(2).map_or_else(|| vec![0.0; outputs], |bias| bias.numbers.clone());
    let count = [n, outputs, rows, columns, inputs, side, side].iter().fold(1_usize, |all, &x| all.saturating_mul(x));
    if bias.len() != outputs || count > MOST_PRODUCTS {
        return Err("its sizes are impossible".to_owned());
    }
    let mut numbers = Vec::with_capacity(n * outputs * rows * columns);
    for image in 0..n {
        for (output, &bias) in bias.iter().enumerate() {
            let mut plane = vec![bias; rows * columns];
            for input in 0..inputs {
                let pixels = &x.numbers[(image * channels + input) * height * width..][..height * width];
                let kernel = &w.numbers[(output * inputs + input) * side * side..][..side * side];
                for (at, &weight) in kernel.iter().enumerate() {
                    let (dy, dx) = (at / side, at % side);
                    for row in 0..rows {
                        let Some(y) = (row * window.stride + dy).checked_sub(window.pad).filter(|y| *y < height) else {
                            continue;
                        };
                        for column in 0..columns {
                            let from = (column * window.stride + dx).checked_sub(window.pad);
                            if let Some(from) = from.filter(|x| *x < width) {
                                plane[row * columns + column] += weight * pixels[y * width + from];
                            }
                        }
                    }
                }
            }
            numbers.extend(plane);
        }
    }
    Ok(Value { elem: x.elem, shape: vec![n, outputs, rows, columns], numbers })
}

fn max_pool(node: &NodeProto, x: &Value) -> Result<Value, String> {
    let window = Window::of(node, None)?;
    let [n, channels, height, width] = image(x)?;
    let (rows, columns) = (window.places(height)?, window.places(width)?);
    let mut numbers = Vec::with_capacity(n * channels * rows * columns);
    for plane in x.numbers.chunks_exact((height * width).max(1)) {
        for row in 0..rows {
            for column in 0..columns {
                let side = |place: usize, size: usize| {
                    let from = (place * window.stride).saturating_sub(window.pad);
                    from..(place * window.stride + window.side).saturating_sub(window.pad).min(size)
                };
                let ys = side(row, height);
                let pixels = ys.flat_map(|y| side(column, width).map(move |x| plane[y * width + x]));
                numbers.push(pixels.fold(f64::NEG_INFINITY, f64::max));
            }
        }
    }
    Ok(Value { elem: x.elem, shape: vec![n, channels, rows, columns], numbers })
}

/// Computes one recurrent layer in the forward direction.
fn gru(node: &NodeProto, inputs: &[Option<&Value>]) -> Computed {
    let given = |at: usize| inputs.get(at).copied().flatten();
    let part = |at: usize| given(at).ok_or_else(|| format!("its input {at} is missing"));
    let (x, w, r) = (part(0)?, part(1)?, part(2)?);
    let direction = node.text("direction");
    if !(direction.is_empty() || direction == "forward") || node.int("layout", 0) != 0 {
        return Err("it does not go forward, or has the batch first".to_owned());
    }
    if node.int("linear_before_reset", 0) != 1 || node.attribute("activations").is_some() || given(4).is_some() {
        return Err("it resets before the linear layer, or has other functions or lengths".to_owned());
    }
    let ([steps, batch, width], [_, gates, _]) = (three(x)?, three(w)?);
    let hidden = gates / 3;
    let bias = given(3).map_or_else(|| vec![0.0; 6 * hidden], |bias| bias.numbers.clone());
    let mut state = given(5).map_or_else(|| vec![0.0; batch * hidden], |h| h.numbers.clone());
    if w.numbers.len() != 3 * hidden * width
        || r.numbers.len() != 3 * hidden * hidden
        || bias.len() != 6 * hidden
        || state.len() != batch * hidden
    {
        return Err("its weights do not fit its input".to_owned());
    }
    let of_row = |weights: &[f64], row: &[f64], unit: usize, bias: f64| {
        let weights = &weights[unit * row.len()..(unit + 1) * row.len()];
        bias + weights.iter().zip(row).map(|(w, x)| w * x).sum::<f64>()
    };
    let mut all = Vec::with_capacity(steps * batch * hidden);
    for step in 0..steps {
        let mut next = Vec::with_capacity(batch * hidden);
        for row in 0..batch {
            let input = &x.numbers[(step * batch + row) * width..][..width];
            let before = &state[row * hidden..(row + 1) * hidden];
            for unit in 0..hidden {
                let gate = |gate: usize| {
                    let at = gate * hidden + unit;
                    (of_row(&w.numbers, input, at, bias[at]), of_row(&r.numbers, before, at, bias[3 * hidden + at]))
                };
                let ((z_x, z_h), (r_x, r_h), (n_x, n_h)) = (gate(0), gate(1), gate(2));
                let update = sigmoid(z_x + z_h);
                let new = libm::tanh(n_x + sigmoid(r_x + r_h) * n_h);
                next.push((1.0 - update) * new + update * before[unit]);
            }
        }
        all.extend_from_slice(&next);
        state = next;
    }
    let outputs = Value { elem: x.elem, shape: vec![steps, 1, batch, hidden], numbers: all };
    Ok(vec![outputs, Value { elem: x.elem, shape: vec![1, batch, hidden], numbers: state }])
}

fn three(x: &Value) -> Result<[usize; 3], String> {
    x.shape[..].try_into().map_err(|_| format!("it reads no sequences: {:?}", x.shape))
}
